"""Quantiles of the chi-squared distribution, for standard deviations of few values."""

from __future__ import annotations

import math

_STEPS = 200


def chi_squared_share(value: float, degrees: float) -> float:
    """Return the share of the distribution below a value: the regularised lower incomplete gamma function.

    Parameters
    ----------
    value : float
        At least 0.
    degrees : float
        Of freedom, above 0; need not be whole.

    Notes
    -----
    Its power series: DLMF 8.7.1.
    """
    a, x = degrees / 2, value / 2
    if x <= 0:
        return 0.0
    term = total = 1 / a
    n = 0
    while term > 1e-16 * total:
        n += 1
        term *= x / (a + n)
        total += term
    return min(1.0, total * math.exp(a * math.log(x) - x - math.lgamma(a)))


def chi_squared_quantile(share: float, degrees: float) -> float:
    """Return the value below which a share of the distribution lies.

    Parameters
    ----------
    share : float
        Between 0 and 1, both excluded.
    degrees : float
        Of freedom, above 0.
    """
    low, high = 0.0, degrees + 10.0
    while chi_squared_share(high, degrees) < share:
        high *= 2
    for _ in range(_STEPS):
        middle = (low + high) / 2
        if middle in {low, high}:
            break
        low, high = (middle, high) if chi_squared_share(middle, degrees) < share else (low, middle)
    return (low + high) / 2


def std_interval(std: float, degrees: float, *, confidence: float = 0.95) -> tuple[float, float]:
    """Return the interval in which the true standard deviation lies, for normal errors.

    Parameters
    ----------
    std : float
        As seen.
    degrees : float
        Of freedom that it was seen with.
    confidence : float
        How often the interval holds.
    """
    tail = (1 - confidence) / 2
    low, high = (std * math.sqrt(degrees / chi_squared_quantile(q, degrees)) for q in (1 - tail, tail))
    return low, high

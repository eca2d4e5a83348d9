"""Curves over time as a paper prints them: by point, with their uncertainty as a band."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.view.frames import new_figure

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from garment_dataset.arrays import FloatArray

WIDTH_INCHES = 7.16
"""Of a page of two columns."""

_ROW_INCHES, _FRAME_INCHES = 2.1, 0.7
_BAND_STDS = 2.0
_SHOWN_WHOLE = 0.9  # share of the bands
_MARGIN = 0.05
_BRIGHTEST = 0.85  # of viridis: brighter yellow is lost on paper
_STYLE: Any = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 8,
    "lines.linewidth": 1.0,
    "axes.grid": True,
    "grid.linewidth": 0.3,
    "pdf.fonttype": 42,  # text that can be searched
    "svg.fonttype": "none",
    "svg.hashsalt": "garment",  # equal curves give equal bytes
}


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One line over time.

    Parameters
    ----------
    point : int or None
        Number of the point, 0 for the gripper; None where it is of none.
    time_s : (T,) float64
        Increasing.
    value : (T,) float64
        NaN where there is none: the line is broken there.
    std : (T,) float64 or None
        Standard uncertainty, drawn as a band of twice its height.
    """

    point: int | None
    time_s: FloatArray
    value: FloatArray
    std: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves that share their axes.

    Parameters
    ----------
    title : str
        Above it.
    quantity : str
        With its unit.
    curves : sequence of Curve
        Of several recordings or of one.
    """

    title: str
    quantity: str
    curves: Sequence[Curve]


def save_curves(rows: Sequence[Sequence[Panel]], time_label: str, path: Path) -> None:
    """Draw panels in rows, all over the same time, and write them.

    Parameters
    ----------
    rows : sequence of sequence of Panel
        All of one length.
    time_label : str
        What is along the abscissa, with its unit.
    path : Path
        Its suffix says the format.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """
    figure = new_figure()
    import matplotlib as mpl

    with mpl.rc_context(_STYLE):
        figure.set_size_inches(WIDTH_INCHES, _FRAME_INCHES + _ROW_INCHES * len(rows))
        _draw(figure, rows, time_label)
        # no date: equal curves give equal bytes
        nothing = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(path.suffix, {})
        figure.savefig(path, dpi=300, metadata=nothing)


def _draw(figure: Figure, rows: Sequence[Sequence[Panel]], time_label: str) -> None:
    axes = figure.subplots(len(rows), len(rows[0]), squeeze=False, sharex=True, sharey="col")
    last = max((curve.point or 0 for row in rows for panel in row for curve in panel.curves), default=0)
    labelled: dict[str, Any] = {}
    for line, row in zip(axes, rows, strict=True):
        for each, panel in zip(line, row, strict=True):
            labelled |= _draw_panel(each, panel, last)
    for column, each in enumerate(axes[-1]):
        each.set_xlabel(time_label)
        if (limits := value_limits([curve for row in rows for curve in row[column].curves])) is not None:
            each.set_ylim(*limits)
    if labelled:
        figure.legend(labelled.values(), labelled.keys(), loc="outside lower center", ncols=min(len(labelled), 7))


def _draw_panel(axes: Axes, panel: Panel, last: int) -> dict[str, Any]:
    """Draw the curves; return one line for each name."""
    labelled: dict[str, Any] = {}
    for curve in panel.curves:
        style = _style(curve.point, last)
        (line,) = axes.plot(curve.time_s, curve.value, **style)
        if curve.std is not None:
            low, high = curve.value - _BAND_STDS * curve.std, curve.value + _BAND_STDS * curve.std
            axes.fill_between(curve.time_s, low, high, color=style["color"], alpha=0.2, linewidth=0)
        if curve.point is not None:
            labelled.setdefault("gripper" if curve.point == 0 else f"point {curve.point}", line)
    axes.set_title(panel.title, loc="left")
    axes.set_ylabel(panel.quantity)
    return labelled


def value_limits(curves: Sequence[Curve]) -> tuple[float, float] | None:
    """Return from where to where an axis goes; None where the values leave that open.

    All values are shown, and most bands whole. A few frames that say next to nothing have bands many times as high as
    all motion: these go beyond the panel, where they would press the curves flat.

    Parameters
    ----------
    curves : sequence of Curve
        That share the axis.
    """
    ends = []
    for curve in curves:
        known = np.isfinite(curve.value)
        if known.any():
            stds = np.zeros(1) if curve.std is None else curve.std[known & np.isfinite(curve.std)]
            band = _BAND_STDS * float(np.quantile(stds, _SHOWN_WHOLE)) if stds.size else 0.0
            ends += [float(curve.value[known].min()) - band, float(curve.value[known].max()) + band]
    if not ends or min(ends) == max(ends):
        return None
    margin = _MARGIN * (max(ends) - min(ends))
    return min(ends) - margin, max(ends) + margin


def _style(point: int | None, last: int) -> dict[str, Any]:
    """Return how a point is drawn: from dark to bright along the garment, in grey too; the gripper black."""
    if not point:
        return {"color": "black", "linestyle": "--" if point == 0 else "-", "zorder": 3}
    return {"color": point_color(point, last), "linestyle": "-"}


def point_color(point: int, last: int, ends: tuple[float, float] = (0.0, _BRIGHTEST)) -> str:
    """Return the colour of a point's curve, ``#rrggbb``: from dark to bright along the garment.

    Parameters
    ----------
    point, last : int
        Its number, from 1, and that of the last.
    ends : (float, float)
        Where in viridis the first and the last lie: on a dark ground its dark end is not seen.
    """
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    share = 0.0 if last < 2 else (point - 1) / (last - 1)
    return to_hex(colormaps["viridis"](ends[0] + share * (ends[1] - ends[0])))


def broken_at_gaps(curve: Curve, longest_s: float) -> Curve:
    """Return a curve that is not drawn across gaps in time.

    Parameters
    ----------
    curve : Curve
        In increasing time.
    longest_s : float
        Of what is drawn across.
    """
    after = np.flatnonzero(np.diff(curve.time_s) > longest_s) + 1
    if not after.size:
        return curve
    time_s = np.insert(curve.time_s, after, curve.time_s[after])
    value = np.insert(curve.value, after, np.nan)
    return Curve(curve.point, time_s, value, None if curve.std is None else np.insert(curve.std, after, np.nan))

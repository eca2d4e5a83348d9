"""Canonical JSON and digests: equal facts have equal names, on every machine.

Every pre-image begins with a tag that says what kind of thing it names, so that two kinds can never share a digest.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def canonical_json(value: Any) -> str:  # noqa: ANN401 - anything JSON can hold
    """Return ``value`` as JSON with sorted keys, no blanks and no NaN.

    Raises
    ------
    ValueError
        If a float is not finite.
    TypeError
        If something in it has no JSON form.
    """
    return _ENCODER.encode(value)


def digest(tag: str, value: Any) -> str:  # noqa: ANN401 - anything JSON can hold
    """Return the sha256 (64 hex digits) of a tagged value.

    Parameters
    ----------
    tag : str
        Kind and version of the pre-image, such as ``node/1``.
    value : JSON-like
        What is named.
    """
    return hashlib.sha256(f"{tag}\n{canonical_json(value)}".encode()).hexdigest()

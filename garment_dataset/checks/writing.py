"""A contract as the text of its file, with what each entry means beside it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from garment_dataset.checks.contract import Contract

_ABOUT = {
    "duration_s": "from the first to the last message",
    "max_late_s": "required topics that have a rate begin and end at most this long after and before the recording",
    "max_stamp_offset_s": "header stamp less record time, at most this far from its median",
    "types": "which will do",
    "required": "must it be there, with messages?",
    "rate_hz": "least and greatest rate",
    "max_gap_s": "longest time without a message",
    "max_frozen_s": "longest time with the same image, pixel by pixel",
    "least_valid": "share of pixels with a return, below which nothing is to be seen",
    "least_contrast": "standard deviation of the grey levels, below which nothing is to be seen",
    "camera_frame": "empty: that of the images",
    "least_known": "share of the images at which the end point is known",
    "least_in_view": "share of these at which the camera sees it",
    "least_travel_m": "greatest extent of its way along one of the camera's axes",
    "axes": "recordings along which axes need a bag of the empty scene",
}
_ONCE = {"types", "required", "rate_hz", "max_gap_s", "max_frozen_s"}
"""Explained where they first stand."""


def to_toml(contract: Contract, title: str) -> str:
    """Return the text of a contract's file; read again, it is the same contract.

    Parameters
    ----------
    contract : Contract
        What to write.
    title : str
        What to say above it, in one line.
    """
    told: set[str] = set()
    return "\n".join([f"# {title}", *_lines("", contract.model_dump(exclude_none=True), told)]) + "\n"


def _lines(table: str, entries: Mapping[str, Any], told: set[str]) -> Iterator[str]:
    """Yield the lines of a table, its plain entries before its tables."""
    plain = {name: value for name, value in entries.items() if not isinstance(value, dict)}
    if plain:
        yield f"\n[{table}]"
    for name, value in plain.items():
        about = _ABOUT.get(name) if name not in told else None
        told |= {name} & _ONCE
        yield f"{name} = {_value(value)}" + (f"  # {about}" if about else "")
    for name, value in entries.items():
        if isinstance(value, dict):
            key = name if name.isidentifier() else json.dumps(name, ensure_ascii=False)
            yield from _lines(f"{table}.{key}" if table else key, value, told)


def _value(value: Any) -> str:  # noqa: ANN401 - anything a contract can hold
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value, ensure_ascii=False)

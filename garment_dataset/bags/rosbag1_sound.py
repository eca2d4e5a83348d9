"""Which chunks of a ROS 1 bag hold what its index says, and nothing else: found for all of them together."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.bags.rosbag1_layout import USUAL_MESSAGE, USUAL_MESSAGE_BYTES, Entry
from garment_dataset.bags.rosbag1_records import TIME, UINT32
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

_HEAD_BYTES = USUAL_MESSAGE_BYTES + UINT32.size


def sound_chunks(
    entries: Mapping[int, list[Entry]],
    table: Mapping[int, Mapping[int, int]],
    open_chunk: Callable[[int], memoryview],
) -> set[int]:
    """Return the places of chunks that are exactly the messages that the index names, one behind the other.

    Parameters
    ----------
    entries : mapping of int to list of Entry
        What the index names in each chunk.
    table : mapping of int to mapping
        How many messages of each connection the chunk table says are in a chunk.
    open_chunk : callable
        Returns the plain content of a chunk, or raises MessageError.

    Notes
    -----
    Of the others nothing is known: a chunk with a connection record in it, as every connection has one somewhere, has
    to be walked.
    """
    heads: list[memoryview] = []
    rows: list[Entry] = []
    chunks: list[tuple[int, int, int]] = []  # place, end of its rows, length
    for position, said in entries.items():
        try:
            content = open_chunk(position)
        except MessageError:
            continue
        named = sorted(said)
        if not named or named[-1].offset + _HEAD_BYTES > len(content) or not _is_counted(named, table.get(position)):
            continue
        heads += [content[entry.offset : entry.offset + _HEAD_BYTES] for entry in named]
        rows += named
        chunks.append((position, len(rows), len(content)))
    if not rows:
        return set()
    places, stops, lengths = np.array(chunks, np.int64).T
    as_said, ends = _as_said(b"".join(heads), np.array(rows, np.int64))
    begins = np.roll(ends, 1)  # of each record, where the one before it ends
    begins[0] = 0
    begins[stops[:-1]] = 0
    as_said &= begins == np.array([entry.offset for entry in rows])
    whole = np.logical_and.reduceat(as_said, np.concatenate([[0], stops[:-1]])) & (ends[stops - 1] == lengths)
    return set(places[whole].tolist())


def _is_counted(named: list[Entry], counts: Mapping[int, int] | None) -> bool:
    return counts is None or Counter(entry.connection for entry in named) == Counter(counts)


def _as_said(heads: bytes, rows: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Return whether each record is the message that a row says (offset, connection, stamp), and where it ends."""
    match = USUAL_MESSAGE.match(heads)
    if match is None or match.end() != USUAL_MESSAGE_BYTES or not match["conn"] or not match["time"]:
        return np.zeros(len(rows), bool), np.zeros(len(rows), np.int64)
    records = np.frombuffer(heads, np.uint8).reshape(-1, _HEAD_BYTES)
    conn, time = match.start("conn"), match.start("time")
    fixed = np.ones(USUAL_MESSAGE_BYTES, bool)
    fixed[conn : conn + UINT32.size] = fixed[time : time + TIME.size] = False
    usual = (records[:, :USUAL_MESSAGE_BYTES] == records[0, :USUAL_MESSAGE_BYTES])[:, fixed].all(axis=1)
    seconds, nanoseconds, numbers, sizes = (
        np.ascontiguousarray(records[:, place : place + UINT32.size]).view("<u4")[:, 0].astype(np.int64)
        for place in (time, time + UINT32.size, conn, USUAL_MESSAGE_BYTES)
    )
    offsets, connections, stamps_ns = rows.T
    as_said: NDArray[np.bool_] = usual & (numbers == connections) & (seconds * 10**9 + nanoseconds == stamps_ns)
    return as_said, offsets + _HEAD_BYTES + sizes

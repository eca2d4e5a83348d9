"""An index for a ROS 1 bag that lacks nothing but its own: made from the records, in memory, the file untouched."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, NamedTuple

from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import Chunk, IndexData

from garment_dataset.bags.inflation import inflate
from garment_dataset.bags.rosbag1_recovery import learn_connections
from garment_dataset.bags.rosbag1_scan import scan_bag, scan_content
from garment_dataset.bags.rosbag1_writer import connection_record
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from rosbags.interfaces import Connection

    from garment_dataset.bags.rosbag1_layout import Fields
    from garment_dataset.bags.rosbag1_scan import Saved, Scan, ScannedChunk


class Reindexed(NamedTuple):
    """What rosbags would read from the index, if there were one.

    Parameters
    ----------
    connections : list of Connection
        By number.
    entries : dict of int to list of IndexData
        The messages of each connection, in the order of the file.
    chunks : dict of int to Chunk
        By their place in the file.
    """

    connections: list[Connection]
    entries: dict[int, list[IndexData]]
    chunks: dict[int, Chunk]


def index_anew(path: Path, content: memoryview) -> Reindexed | None:
    """Return an index of a bag all of whose messages are whole; None if anything else than its index is damaged.

    Parameters
    ----------
    path : pathlib.Path
        The bag.
    content : memoryview
        What it holds.
    """
    scan = scan_bag(content)
    described, contradicted = learn_connections(content, scan)
    if contradicted or not described or not _is_whole(content, scan):
        return None
    index: dict[int, list[IndexData]] = {number: [] for number in sorted(described)}
    chunks: dict[int, Chunk] = {}
    for chunk in scan.chunks:
        messages = _messages(content, chunk)
        if messages is None or any(each.connection not in index for each in messages):
            return None
        start = chunk.stored.start
        end = (
            chunk.stored.stop
            if chunk.compression != "none"
            else max((each.data.stop for each in messages), default=start)
        )
        chunks[chunk.position] = Chunk(end - start, start, bytes)
        shift = start if chunk.compression == "none" else 0
        for each in messages:
            index[each.connection].append(IndexData(each.stamp_ns, chunk.position, each.offset - shift))
    return Reindexed(_connections(path, described, index), index, chunks)


def _is_whole(content: memoryview, scan: Scan) -> bool:
    """Return whether all chunks that the bag header counts are there, and what cannot be read stands behind them.

    The header of a bag that no recorder has closed counts none.
    """
    if not scan.chunks or scan.said_chunks not in (0, len(scan.chunks)):
        return False
    last = scan.chunks[-1]
    ends = [each.data.stop for each in last.messages] if last.compression == "none" else [last.stored.stop]
    end = max(ends, default=len(content) + 1)
    if end > len(content) or last.size_bytes is None or (last.compression == "none" and last.stored.stop > end):
        return False
    return all(place >= end for place in (*(gap.start for gap in scan.gaps), *([scan.cut] if scan.cut else [])))


def _messages(content: memoryview, chunk: ScannedChunk) -> list[Saved] | None:
    if chunk.compression == "none":
        return chunk.messages
    if chunk.size_bytes is None:
        return None
    try:
        plain = memoryview(inflate(chunk.compression, content[chunk.stored], chunk.size_bytes))
    except MessageError:
        return None
    found = scan_content(plain)
    return None if found.gaps else [each for part in found.chunks for each in part.messages]


def _connections(path: Path, described: Mapping[int, Fields], index: Mapping[int, list[IndexData]]) -> list[Connection]:
    reader = Reader(path)
    found = []
    for number, said in sorted(described.items()):
        reader.bio = io.BytesIO(connection_record(number, said))
        found.append(reader.read_connection()._replace(msgcount=len(index[number])))
    return found

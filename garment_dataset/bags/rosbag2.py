"""ROS 2 recordings: rosbag2 folders with sqlite3 or mcap storage, or one storage file of such a folder.

rosbags reads them, and its copies of the messages are handed on: there is no index to map, so that the place of a
message in the file is not known. Unlike in a ROS 1 bag, damaged storage ends the reading with a BagError.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, cast

from garment_dataset.bags.bag import Bag, summarise
from garment_dataset.bags.messages import Payload, Record
from garment_dataset.bags.reporting import reporting
from garment_dataset.bags.rosbag2_check import check_lengths, check_mcap, check_metadata, check_sqlite
from garment_dataset.bags.rosbag2_storage import METADATA, Rosbag2Reader
from garment_dataset.errors import BagError, MessageError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

_HINT = "Run `ros2 bag reindex` on a copy of it."


class Rosbag2(Bag):
    """A rosbag2 folder, or a ``.db3`` or ``.mcap`` file of one.

    Raises
    ------
    BagError
        If the folder has no metadata, or metadata or storage cannot be read.
    """

    _cdr = True

    def __init__(self, path: Path) -> None:
        files = sorted(each for each in path.iterdir() if each.is_file()) if path.is_dir() else [path]
        super().__init__(path, files)
        if path.is_dir() and path / METADATA not in files:
            raise BagError("is not a rosbag2 folder", where=path, expected="metadata.yaml in it", hint=_HINT)
        with reporting(path, "cannot be opened", _HINT):
            for file in files:
                if file.suffix == ".mcap":
                    check_lengths(file)
            self._reader = Rosbag2Reader(path)
            self._reader.open()
            if path.is_dir():  # one file is read after the other; which is the first, their stamps say
                storages: list[Any] = cast("Any", self._reader.storage).storages
                storages.sort(key=lambda storage: storage.metadata.start_time)
            self.topics = summarise(self._reader.connections)

    def contradictions(self) -> list[str]:
        """Compare metadata and indexes with the storage, all of which is read; verify every checksum it has."""
        self._check_open()
        with reporting(self.path, "its storage is damaged", _HINT):
            return list(self._contradictions())

    def _contradictions(self) -> Iterator[str]:
        storage: Any = self._reader.storage
        storages = storage.storages if self.path.is_dir() else [storage]
        for each in storages:
            yield from check_sqlite(each) if hasattr(each, "dbconn") else check_mcap(each.path)
        if self.path.is_dir():
            yield from check_metadata(storage, [file.name for file in self._files if file.name != METADATA])

    def _records(self, topics: Collection[str]) -> Iterator[Record]:
        self._check_open()
        connections = [each for each in self._reader.connections if each.topic in topics]
        if not connections:  # to rosbags, none means all
            return
        with reporting(self.path, "cannot be read to its end", _HINT):
            for connection, stamp_ns, data in self._reader.messages(connections):
                _check_types(stamp_ns, data)
                yield Record(connection, stamp_ns, partial(Payload, memoryview(data), None))

    def _release(self) -> None:
        self._reader.close()


def _check_types(stamp_ns: object, data: object) -> None:
    """Refuse what a database may hold in these columns, whose types bind nobody."""
    if not isinstance(stamp_ns, int) or not isinstance(data, bytes):
        found = f"{type(stamp_ns).__name__} and {type(data).__name__}"
        raise MessageError("stamp and data", expected="int and bytes", found=found)

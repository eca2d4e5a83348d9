"""Opening rosbag2 recordings that are sound, but not as rosbags wants them.

* Folders and files whose names mean something in the URI of a database: ``?``, ``#``, ``%``.
* ``metadata.yaml`` without a storage identifier, as ``ros2 bag reindex`` has left it: the files' names tell.
* Topics of another serialisation than CDR, and mcap schemas in no language of ROS: they are left out, or not looked
  into, and the others are read.
"""

from __future__ import annotations

import io
from pathlib import Path, PosixPath
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from rosbags.rosbag2 import Reader
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rosbags.rosbag2.storage_mcap import Schema

METADATA = "metadata.yaml"
_DEFINITIONS = ("ros2msg", "ros2idl", "omgidl", "")


class _UriPath(PosixPath):
    """A path that is text for the URI of a database, and a file for everybody else."""

    def __fspath__(self) -> str:
        return str(Path(self))

    def __str__(self) -> str:
        return quote(str(Path(self)))


class _Metadata(PosixPath):
    """Metadata that name a storage, and topics in CDR alone."""

    def read_text(self, *_: object, **__: object) -> str:
        return _mended(Path(self).read_text("utf-8"))


class _FolderPath(PosixPath):
    def __truediv__(self, name: Any) -> Any:  # noqa: ANN401 - as Path has it
        inside = Path(self) / name
        return _Metadata(inside) if inside.name == METADATA else inside


class _Sqlite(Sqlite3Reader):
    def __init__(self, path: Path) -> None:
        super().__init__(_UriPath(path))


class _Schemas(dict[int, "Schema"]):
    """Schemas of an mcap file; of those in no language of ROS only the name is kept."""

    def __setitem__(self, number: int, schema: Schema) -> None:
        known = schema.encoding in _DEFINITIONS
        super().__setitem__(number, schema if known else schema._replace(encoding="", data=""))


class _Mcap(McapReader):
    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.schemas = _Schemas()


class _Folder(DirectoryReader):
    STORAGE_PLUGINS: Any = {"mcap": _Mcap, "sqlite3": _Sqlite}  # noqa: RUF012 - rosbags has it on its instances

    def __init__(self, path: Path) -> None:
        super().__init__(_FolderPath(path))


class Rosbag2Reader(Reader):
    """rosbags' reader of a rosbag2 folder, or of one of its files, for the kinds above, too."""

    STORAGE_PLUGINS: Any = {"dir": _Folder, ".mcap": _Mcap, ".db3": _Sqlite}  # noqa: RUF012


def _mended(text: str) -> str:
    """Return metadata with what can be told added, and with what rosbags would refuse left out."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    yaml = YAML(typ="safe")
    try:
        known = yaml.load(text)
        said = known["rosbag2_bagfile_information"]
        topics, identifier = said["topics_with_message_count"], said["storage_identifier"]
        spoken = [each for each in topics if each["topic_metadata"]["serialization_format"] == "cdr"]
        names = [str(name) for name in said["relative_file_paths"]]
    except (YAMLError, LookupError, TypeError):
        return text  # rosbags says what is wrong
    if identifier and (len(spoken) == len(topics) or not spoken):
        return text
    said["storage_identifier"] = identifier or _storage_of(names)
    said["topics_with_message_count"] = spoken
    mended = io.StringIO()
    yaml.dump(known, mended)
    return mended.getvalue()


def _storage_of(names: Sequence[str]) -> str:
    """Return the identifier that the names of storage files stand for; nothing if they stand for none."""
    kinds = {Path(name.removesuffix(".zstd")).suffix for name in names}
    return {".db3": "sqlite3", ".mcap": "mcap"}.get(kinds.pop(), "") if len(kinds) == 1 else ""

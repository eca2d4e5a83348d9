"""What every recording offers, whatever its format."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from hashlib import blake2b
from typing import TYPE_CHECKING, ClassVar

from garment_dataset.bags.definitions import UNREADABLE, has_common_transforms, leading_header, reason, typestore_of
from garment_dataset.bags.headers import ImageHeader, ImageHeaders, read_stamp_ns
from garment_dataset.bags.messages import Glance, ImageMessage, Message, Record, Topic, image_forms
from garment_dataset.bags.stated_transforms import TRANSFORMS, read_stated_transforms, stated_transforms
from garment_dataset.errors import BagError, DataWarning, MessageError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path
    from types import TracebackType
    from typing import Self

    from rosbags.interfaces import Connection

    from garment_dataset.bags.images import Kind
    from garment_dataset.bags.stated_transforms import StatedTransform

_WHOLE_BYTES, _END_BYTES = 4096, 256  # of longer messages, a glance takes both ends: reading images takes seconds


class Bag(ABC):
    """An open recording; :func:`garment_dataset.bags.open_bag` makes one.

    A context manager, and a reader only: it never writes. Messages come in the order of their record stamps, equal ones
    in the order of the file, on every run.

    Attributes
    ----------
    path : pathlib.Path
        As given.
    topics : mapping of str to Topic
        Sorted by name.
    """

    path: Path
    topics: Mapping[str, Topic]
    _cdr: ClassVar[bool]

    def __init__(self, path: Path, files: Sequence[Path]) -> None:
        self.path = path
        self.topics = {}
        self._closed = False
        self._files = files
        self._states = _file_states(files)

    @abstractmethod
    def _records(self, topics: Collection[str]) -> Iterator[Record]:
        """Yield the messages on ``topics`` in order, not yet looked into."""

    @abstractmethod
    def contradictions(self) -> list[str]:
        """Tell where the recording does not hold what it says of itself, in one line each; none of a sound one.

        Messages are read as its index has them, so that such a line may stand for messages that are missing, or are
        taken for others. Damage that shows in a single message is that message's fault and not repeated here.

        Raises
        ------
        BagError
            If the bag is closed, or (rosbag2 only) if its storage is damaged.
        """

    @abstractmethod
    def _release(self) -> None:
        """Let go of the files."""

    def image_topic(self, base: str) -> str | None:
        """Return the topic that carries the images of ``base``: itself, or a compressed form; None if none has any."""
        return next((name for name in image_forms(base) if name in self.topics and self.topics[name].count), None)

    def images(self, topic: str, kind: Kind) -> Iterator[ImageMessage]:
        """Yield every image message of a topic, faulty ones too.

        Parameters
        ----------
        topic : str
            Messages of type ``sensor_msgs/Image`` or ``sensor_msgs/CompressedImage``.
        kind : {"depth", "color"}
            What the pixels are meant to be; an image of the other kind is faulty.

        Raises
        ------
        BagError
            If the bag has no such topic or is closed, or (rosbag2 only) if its storage is damaged.
        """
        if topic not in self.topics:
            raise BagError("no such topic", where=self.path, expected=topic, found=", ".join(self.topics))
        headers = ImageHeaders(kind, cdr=self._cdr)
        return (self._image(index, record, headers) for index, record in enumerate(self._records({topic})))

    def glances(self, topic: str) -> Iterator[Glance]:
        """Yield what the first and the last bytes of each message of a topic tell; a topic that is missing has none.

        Raises
        ------
        BagError
            If the bag is closed, or (rosbag2 only) if its storage is damaged.
        """
        return (self._glance(record) for record in self._records({topic}))

    def messages(self, *topics: str) -> Iterator[Message]:
        """Yield the deserialised messages of the named topics; a topic that the bag lacks has none.

        Each is read by the definition that its own publisher recorded. At the end, a DataWarning names those that could
        not be read.

        Raises
        ------
        BagError
            If the bag is closed, or (rosbag2 only) if its storage is damaged.
        """
        return self._messages(topics, self._deserialise)

    def transforms(self, *topics: str) -> Iterator[Message]:
        """Do as :meth:`messages` on topics of transforms, faster: ``data`` is a list of StatedTransform.

        Messages of other types have None.
        """
        return self._messages(topics, self._transforms)

    def distinct(self, topic: str) -> list[tuple[Message, int]]:
        """Do as :meth:`messages`, each message once that says the same but for the stamp of its header.

        Returns
        -------
        list of (Message, int)
            The first that says so, and how many do. A camera says the same all along.
        """
        known: dict[bytes, object] = {}

        def read(record: Record) -> object:
            said = self._but_for_stamp(record)
            if said not in known:
                known[said] = self._deserialise(record)
            return known[said]

        found: dict[int, tuple[Message, int]] = {}
        for message in self._messages((topic,), read):
            first, count = found.get(id(message.data), (message, 0))
            found[id(message.data)] = first, count + 1
        return list(found.values())

    def _messages(self, topics: Collection[str], read: Callable[[Record], object]) -> Iterator[Message]:
        counts = dict.fromkeys(topics, 0)
        left_out: dict[str, list[str]] = {}
        for record in self._records(counts.keys()):
            topic, message_type = record.connection.topic, record.connection.msgtype
            index = counts[topic]
            counts[topic] += 1
            try:
                data = read(record)
            except MessageError as error:
                left_out.setdefault(topic, []).append(f"{index} ({error})")
            else:
                yield Message(topic, message_type, index, record.stamp_ns, data)
        for topic, faults in left_out.items():
            text = f"left out {len(faults)} of {counts[topic]} messages: {_shortened(faults)}"
            warnings.warn(f"{self.path.name}: {topic}: {text}", DataWarning, stacklevel=2)

    def close(self) -> None:
        """Let go of the files.

        Raises
        ------
        BagError
            If one of them changed since the bag was opened: what was read may be a mixture.
        """
        if self._closed:
            return
        self._closed = True
        self._release()
        if _file_states(self._files) != self._states:
            hint = "Read it again when nothing writes to it."
            raise BagError("changed while it was read", where=self.path, hint=hint)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            self.close()
        except BagError:
            if error is None:
                raise

    def _image(self, index: int, record: Record, headers: ImageHeaders) -> ImageMessage:
        offset_bytes = None
        try:
            payload = record.read()
        except MessageError as error:
            header = ImageHeader(fault=str(error))
        else:
            header = headers.read(payload.data, record.connection.msgtype)
            if not (payload.offset_bytes is None or header.start_bytes is None or header.compressed):
                offset_bytes = payload.offset_bytes + header.start_bytes
        return ImageMessage(
            index,
            record.stamp_ns,
            header.stamp_ns,
            header.frame_id,
            header.encoding,
            header.width_px,
            header.height_px,
            header.step_bytes,
            offset_bytes,
            header.size_bytes,
            header.fault,
            record,
            header,
        )

    def _glance(self, record: Record) -> Glance:
        connection = record.connection
        leading = leading_header(connection.msgtype, connection.msgdef)
        try:
            data = record.read().data
            ends = (len(data).to_bytes(8), data[:_END_BYTES], data[-_END_BYTES:] if len(data) > _WHOLE_BYTES else data)
            digest = blake2b(b"".join(ends), digest_size=16).digest()
            stamp_ns = None if leading is None else read_stamp_ns(data, leading, cdr=self._cdr)
        except MessageError as error:
            return Glance(record.stamp_ns, None, b"", str(error))
        return Glance(record.stamp_ns, stamp_ns, digest, None)

    def _deserialise(self, record: Record) -> object:
        data, connection = record.read().data, record.connection
        store = typestore_of(connection.msgtype, connection.msgdef)
        if isinstance(store, str):
            raise MessageError("its definition cannot be used", found=store)
        deserialise = store.deserialize_cdr if self._cdr else store.deserialize_ros1
        try:
            return deserialise(data, connection.msgtype)
        except UNREADABLE as error:
            raise MessageError("cannot be read", found=reason(error)) from error

    def _transforms(self, record: Record) -> list[StatedTransform] | None:
        connection = record.connection
        if not self._cdr and has_common_transforms(connection.msgtype, connection.msgdef):
            stated = read_stated_transforms(record.read().data)
            if stated is not None:
                return stated
        message = self._deserialise(record)  # says, too, what is wrong with one that is damaged
        return stated_transforms(message) if connection.msgtype in TRANSFORMS else None

    def _but_for_stamp(self, record: Record) -> bytes:
        """Return a message without the stamp that it begins with, if it does; and by whose definition it is read."""
        data, connection = record.read().data, record.connection
        before, behind = (4, 12) if self._cdr else (0, 12)  # the encapsulation stays; the sequence number goes, too
        if leading_header(connection.msgtype, connection.msgdef) != "header":
            before = behind = 0
        return b"".join((connection.id.to_bytes(8), data[:before], data[behind:]))

    def _check_open(self) -> None:
        if self._closed:
            raise BagError("is closed", where=self.path)


def summarise(connections: Iterable[Connection]) -> dict[str, Topic]:
    """Return the topics behind the connections of a bag, sorted by name."""
    by_name: dict[str, list[Connection]] = {}
    for connection in connections:
        by_name.setdefault(connection.topic, []).append(connection)
    return {
        name: Topic(name, tuple(sorted({each.msgtype for each in same})), sum(each.msgcount for each in same))
        for name, same in sorted(by_name.items())
    }


def _shortened(texts: Sequence[str], most: int = 5) -> str:
    return "; ".join(texts[:most]) + ("; …" if len(texts) > most else "")


def _file_states(files: Sequence[Path]) -> list[tuple[int, int] | None]:
    """Return size and mtime_ns of each file, None for one that is gone."""
    return [(path.stat().st_size, path.stat().st_mtime_ns) if path.exists() else None for path in files]

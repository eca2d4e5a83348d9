"""Where a rosbag2 recording does not hold what its summaries say, one line each.

Metadata and summaries decide what is read: a message whose topic they do not list would vanish without a word.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from garment_dataset.bags.mapped import mapped
from garment_dataset.bags.mcap_content import Chunk, McapContent, read_mcap, records, topic_of
from garment_dataset.errors import BagError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from rosbags.interfaces import Connection

_MOST_SHIFT_NS = 10**9  # recorders take start and duration from the same stamps; some round them

Counts = Counter[str]


def check_sqlite(storage: Any) -> Iterator[str]:  # noqa: ANN401 - rosbags' reader of one file
    """Yield what is wrong with the content of a database.

    Parameters
    ----------
    storage : rosbags.rosbag2.storage_sqlite3.Sqlite3Reader
        Open.

    Raises
    ------
    BagError
        If its structure is damaged: a page taken for another's would be pixels of another image.
    """
    path = Path(storage.path)
    where, size_bytes = path.name, path.stat().st_size
    hint = "Run `sqlite3 FILE .recover` on a copy of it."
    (((page_bytes,),), ((pages,),)) = (
        list(storage.dbconn.execute(f"PRAGMA page_{each}")) for each in ("size", "count")
    )
    if size_bytes != page_bytes * pages:  # SQLite fills a cut page up with zeros
        expected, found = f"{pages} pages of {page_bytes} bytes", f"{size_bytes} bytes"
        raise BagError("its database is cut", where=path, expected=expected, found=found, hint=hint)
    ((found,), *_) = storage.dbconn.execute("PRAGMA integrity_check(1)")
    if found != "ok":
        raise BagError("its database is damaged", where=path, found=found, hint=hint)
    log = Path(f"{path}-wal")
    if log.exists() and log.stat().st_size:
        yield f"{where}: messages in {log.name} are left out. Opening it once with `sqlite3` on a copy takes them over"
    kinds = "typeof(timestamp) != 'integer' OR typeof(data) != 'blob'"
    for condition, text in (
        ("topic_id NOT IN (SELECT id FROM topics)", "belong to no topic and are left out"),
        (kinds, "have no whole number as stamp, or no bytes"),
    ):
        ((count,),) = storage.dbconn.execute(f"SELECT count(*) FROM messages WHERE {condition}")  # noqa: S608
        if count:
            yield f"{where}: {count} messages {text}"


def check_lengths(path: Path) -> None:
    """Refuse an mcap file with a record that does not fit (MessageError): rosbags allocates whatever one claims."""
    for _ in records(mapped(path)):
        pass


def check_mcap(path: Path) -> Iterator[str]:
    """Yield where an mcap file's indexes and its chunks contradict each other.

    Raises
    ------
    MessageError
        If a record does not fit, or a checksum is wrong.
    """
    content = read_mcap(mapped(path))
    for text in (*_of_chunks(content), *_of_indexes(content), *_of_counts(content), *_of_descriptions(content)):
        yield f"{path.name}: {text}"


def _of_chunks(content: McapContent) -> Iterator[str]:
    there, named = content.chunks, content.summary_chunks
    if named and content.loose:
        yield f"{content.loose.total()} messages outside of its chunks are left out"
    if named and (unnamed := sorted(there.keys() - named.keys())):
        text = f"{len(unnamed)} of {len(there)} chunks are not in its summary and are left out"
        yield f"{text}, first that at byte {unnamed[0]}"
    if stray := sorted(named.keys() - there.keys()):
        yield f"its summary names {len(stray)} chunks that are not there, first at byte {stray[0]}"
    if wrong := sorted(place for place in named.keys() & there.keys() if there[place] != named[place]):
        first = zip(Chunk._fields, named[wrong[0]], there[wrong[0]], strict=True)
        differing = ", ".join(f"{name} {said!r} for {found!r}" for name, said, found in first if said != found)
        text = f"its summary describes {len(wrong)} chunks otherwise than they are"
        yield f"{text}, first that at byte {wrong[0]}: {differing}"
    outside = [
        (place, each)
        for place, chunk in sorted(there.items())
        for each in content.messages[place]
        if not chunk.start_ns <= each.stamp_ns <= chunk.end_ns
    ]
    if outside:
        text = f"{len(outside)} messages have stamps outside of those of their chunk and are left out"
        yield f"{text}, first at byte {outside[0][1].offset} of the chunk at byte {outside[0][0]}"


def _of_indexes(content: McapContent) -> Iterator[str]:
    indexed = [place for place in sorted(content.chunks) if content.indexed[place]]
    if wrong := [at for at in indexed if Counter(content.indexed[at]) != Counter(content.messages[at])]:
        text = f"the index of {len(wrong)} chunks names other messages than they hold"
        counts = f"{len(content.indexed[wrong[0]])}, {len(content.messages[wrong[0]])} are there"
        yield f"{text}, first that at byte {wrong[0]}: {counts}"
    places = content.summary_index_places
    if wrong := [at for at, said in places.items() if said != content.index_places.get(at)]:
        text = f"its summary names other index records than {len(wrong)} chunks have, whose messages may be left out"
        yield f"{text}, first that at byte {wrong[0]}"
    if bare := [at for at, said in places.items() if {each.channel for each in content.messages.get(at, ())} - {*said}]:
        text = f"{len(bare)} chunks have messages without an index, which are left out"
        yield f"{text}, first that at byte {bare[0]}"


def _of_counts(content: McapContent) -> Iterator[str]:
    if content.statistics is None:
        return
    there = channel_counts(content)
    for channel in sorted({*there, *content.statistics}):
        if there[channel] != content.statistics.get(channel, 0):
            topic = topic_of(content.summarised or content.described, channel)
            text = f"{topic}: {there[channel]} messages are there, {content.statistics.get(channel, 0)}"
            yield f"{text} in its statistics"


def _of_descriptions(content: McapContent) -> Iterator[str]:
    """Tell of channels and schemas that are described in more than one way, and of messages without a channel."""
    for place in sorted({*content.described, *content.summarised}):
        said = content.described.get(place, set()) | content.summarised.get(place, set())
        kind = {3: "schema", 4: "channel"}[place[0]]
        if len(said) > 1:
            yield f"{kind} {place[1]} is described in two ways: {topic_of(content.described, place[1])}"
        elif content.summarised and place not in content.summarised:
            yield f"{kind} {place[1]} is not in its summary: {topic_of(content.described, place[1])}"
    known = {number for kind, number in {*content.described, *content.summarised} if kind == 4}
    if strange := sorted(channel_counts(content).keys() - known):
        yield f"messages of channel {strange[0]} have no topic and are left out"


def channel_counts(content: McapContent) -> Counter[int]:
    """Return how many messages each channel has."""
    return content.loose + Counter(each.channel for chunk in content.messages.values() for each in chunk)


def check_metadata(directory: Any, files: Sequence[str]) -> Iterator[str]:  # noqa: ANN401 - rosbags' reader of a folder
    """Yield where the metadata of a folder contradict its storage files.

    Parameters
    ----------
    directory : rosbags.rosbag2.reader.DirectoryReader
        Open.
    files : sequence of str
        Names of the storage files in the folder.
    """
    there, said = Counts(), Counts()
    for connection in directory.connections:
        said[connection.topic] += connection.msgcount
    for storage in directory.storages:
        for connection in storage.connections:
            there[connection.topic] += connection.msgcount
            if connection.msgcount and not any(_is_same(connection, each) for each in directory.connections):
                name = f"{connection.topic} ({connection.msgtype})"
                yield f"{Path(storage.path).name}: {connection.msgcount} messages of {name} are left out: {_NOT_LISTED}"
    for topic in sorted({*there, *said}):
        if there[topic] != said[topic]:
            yield f"{topic}: {there[topic]} messages are there, {said[topic]} in metadata.yaml"
    if (total := directory.metadata.message_count) != there.total():
        yield f"{there.total()} messages are there, {total} in metadata.yaml"
    yield from _of_times(directory)
    yield from _of_files(directory, files)


_NOT_LISTED = "metadata.yaml describes that topic otherwise, or not at all"


def _is_same(stored: Connection, listed: Connection) -> bool:
    """Return whether rosbags takes messages of the one for messages of the other."""
    alike = (stored.topic, stored.msgtype, stored.ext) == (listed.topic, listed.msgtype, listed.ext)
    return alike and (not stored.digest or not listed.digest or stored.digest == listed.digest)


def _of_times(directory: Any) -> Iterator[str]:  # noqa: ANN401
    full = [each.metadata for each in directory.storages if each.metadata.message_count]
    if not full or not directory.metadata.message_count:
        return
    found = min(each.start_time for each in full), max(each.end_time for each in full)
    said = directory.metadata.start_time, directory.metadata.end_time
    if any(abs(one - other) > _MOST_SHIFT_NS for one, other in zip(found, said, strict=True)):
        first, last = (f"{(one - other) / 1e9:+.3f} s" for one, other in zip(found, said, strict=True))
        yield f"its messages begin {first} and end {last} off what metadata.yaml says: are its files of this recording?"


def _of_files(directory: Any, files: Sequence[str]) -> Iterator[str]:  # noqa: ANN401
    names = [Path(each.path).name for each in directory.storages]
    if repeated := [name for name, count in Counter(names).items() if count > 1]:
        yield f"metadata.yaml lists a file more than once: {', '.join(repeated)}"
    storage_files = [name for name in files if name.removesuffix(".zstd").endswith((".db3", ".mcap"))]
    if unlisted := [name for name in storage_files if not any(name.startswith(each) for each in names)]:
        yield f"metadata.yaml does not list {', '.join(unlisted)}, which is left out"
    counts: Mapping[str, int] = {Path(each["path"]).name: each["message_count"] for each in directory.files}
    for storage in directory.storages:
        name, found = Path(storage.path).name, storage.metadata.message_count
        said = next((count for listed, count in counts.items() if listed.startswith(name)), found)
        if said != found:
            yield f"{name}: {found} messages are there, {said} in metadata.yaml"

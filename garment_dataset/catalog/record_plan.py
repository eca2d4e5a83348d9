"""How a recording of the catalog is made: what the recorder is told, and what is seen to before and afterwards."""

from __future__ import annotations

import os
import re
import shlex
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.catalog.hints import nearest_names
from garment_dataset.catalog.names import BackgroundName
from garment_dataset.errors import CatalogError, RecordingNameError, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from garment_dataset.catalog import BackgroundSource, Catalog, CatalogRow

DURATION_S = 8
"""How long the data set's recordings are: rest, the swing there and back, and the garment's swinging out."""

DEFAULT_TOPICS_FILE = 1
"""The thesis' own topics file: it stands in for one that the catalog lacks."""

_TOPIC = re.compile(r"(?:/[A-Za-z0-9_]+)+")
"""A topic as the tools of both ROS generations take it, from the root."""


@dataclass(frozen=True, slots=True)
class RecordPlan:
    """What to do to make one bag.

    Parameters
    ----------
    recording : str
        Name of a recording, or of an empty scene.
    path : Path
        The ROS 1 bag to be made.
    topics_path : Path
        The topics file.
    topics : tuple of str
        What it names.
    duration_s : int
        How long to record.
    in_the_way : tuple of Path
        Bags of that name that are there already, whole or not: the recorder would overwrite them.
    notes : tuple of str
        What is not as the name says.
    before, afterwards : tuple of str
        What to see to, in order.
    """

    recording: str
    path: Path
    topics_path: Path
    topics: tuple[str, ...]
    duration_s: int
    in_the_way: tuple[Path, ...]
    notes: tuple[str, ...]
    before: tuple[str, ...]
    afterwards: tuple[str, ...]

    @property
    def ros1(self) -> tuple[str, ...]:
        """The words of the command that records it with ROS 1."""
        return ("rosbag", "record", f"--duration={self.duration_s}", "-O", str(self.path), *self.topics)

    @property
    def ros2(self) -> tuple[str, ...]:
        """The words of the command that records it with ROS 2, into a folder.

        Its recorder knows no duration; an interrupt ends it as Ctrl-C does.
        """
        stop = ("timeout", "--signal=INT", str(self.duration_s))
        return (*stop, "ros2", "bag", "record", "-o", str(self.path.with_suffix("")), *self.topics)

    def record(self) -> dict[str, object]:
        """Return it as plain values, for ``--json``; without commands where a bag is in the way."""
        commands = {"ros1": self.ros1, "ros2": self.ros2}
        return {
            **{field: getattr(self, field) for field in self.__slots__},
            "commands": None if self.in_the_way else {kind: shlex.join(words) for kind, words in commands.items()},
        }


def plan_recording(catalog: Catalog, name: str) -> RecordPlan:
    """Plan how a recording, or an empty scene, of the catalog is made; nothing is touched.

    Parameters
    ----------
    catalog : Catalog
        With a folder: the bag goes there.
    name : str
        In any form that is read.

    Raises
    ------
    CatalogError
        If the catalog does not know the name, or its topics file cannot be used.
    UsageError
        If the folder's path is none that can be copied from a terminal.
    """
    assert catalog.found is not None
    known = _known(catalog, name)
    path = catalog.found.folder / f"{known}.bag"
    if not str(path).isprintable():
        hint = "Rename the folder, or have garment.toml name another one."
        raise UsageError("a path that no terminal shows", where=path, hint=hint)
    row = next((row for row in catalog.rows if row.recording == known), None)
    number = catalog.scheme.parse(known).topics_file
    topics_path, topics = _topics(catalog, number)
    notes = []
    if topics_path.stem != str(number):
        notes.append(f"there is no topics file {number}.txt: these are the topics of {topics_path.name}")
    return RecordPlan(
        recording=known,
        path=path,
        topics_path=topics_path,
        topics=topics,
        duration_s=DURATION_S,
        in_the_way=_in_the_way(catalog, known, path),
        notes=tuple(notes),
        before=tuple(_before(catalog, row, path)),
        afterwards=tuple(_afterwards(catalog, row, path)),
    )


def _known(catalog: Catalog, text: str) -> str:
    """Return the name of what is meant, as it is written; refuse what the catalog does not ask for."""
    recordings = [row.recording for row in catalog.rows]
    scenes = [source.source for source in catalog.backgrounds.values() if source.row is None]
    try:
        name = catalog.scheme.parse(text)
    except RecordingNameError as error:
        nearest = nearest_names(catalog.scheme.repair(text) or text, [*recordings, *scenes])
        raise CatalogError(
            "no such recording",
            expected="a name of the catalog",
            found=repr(text),
            hint=f"Did you mean {' or '.join(nearest)}?" if nearest else error.hint,
        ) from error
    if str(name) in (*recordings, *scenes):
        return str(name)
    if isinstance(name, BackgroundName):
        raise CatalogError(
            "no recording needs this empty scene",
            expected=" or ".join(scenes) or "one that the catalog needs",
            found=str(name),
            hint=f"Recordings whose names end in {name.topics_file} would need it: add one to recordings.csv first.",
        )
    nearest = nearest_names(str(name), recordings)
    hint = f"Did you mean {' or '.join(nearest)}? Else add" if nearest else "Add"
    raise CatalogError(
        "no such recording",
        expected="a name of the catalog",
        found=str(name),
        hint=f"{hint} a row to {catalog.folder / 'recordings.csv'}.",
    )


def _topics(catalog: Catalog, number: int) -> tuple[Path, tuple[str, ...]]:
    """Return a topics file and what it names; the thesis' own where the catalog has none of this number."""
    folder = catalog.folder / "topics"
    for each in (number, DEFAULT_TOPICS_FILE):
        if (topics := catalog.topics(each)) is not None:
            path = folder / f"{each}.txt"
            _refuse_topics(path, topics)
            return path, topics
    raise CatalogError("no such topics file", where=folder / f"{number}.txt", hint="Write one, with a topic a line.")


def _refuse_topics(path: Path, topics: tuple[str, ...]) -> None:
    """Refuse what the recorder would wait for in vain, or what a shell or the recorder takes for something else."""
    form = "topics from the root, such as /xtion1/depth/image_raw, a line each"
    if not topics:
        raise CatalogError("a topics file without topics", where=path, expected=form, found="nothing")
    for place, topic in enumerate(topics, start=1):
        if _TOPIC.fullmatch(topic) is None:
            hint = "Comments cannot stand there." if "#" in topic else None
            raise CatalogError(f"not a topic, word {place}", where=path, expected=form, found=repr(topic), hint=hint)
    twice = [topic for topic, count in Counter(topics).items() if count > 1]
    if twice:
        raise CatalogError("a topic given twice", where=path, expected="each once", found=twice[0])


def _in_the_way(catalog: Catalog, name: str, path: Path) -> tuple[Path, ...]:
    """Return what of that name is there: a bag wherever it lies, or a file that the recorder would write to."""
    assert catalog.found is not None
    bags = [bag.path for bag in catalog.found.bags if str(bag.name) == name]
    targets = (path, path.with_name(f"{path.name}.active"), path.with_suffix(""))
    # a link to nothing counts: the recorder would write to where it leads
    return tuple(dict.fromkeys([*bags, *(target for target in targets if os.path.lexists(target))]))


def _before(catalog: Catalog, row: CatalogRow | None, path: Path) -> Iterator[str]:
    """Yield what to see to before a recording, or before the empty scene is recorded (thesis 3.3 to 3.5)."""
    if not path.parent.is_dir():
        yield f"Make the folder: mkdir -p {shlex.quote(str(path.parent))}"
    yield "Turntable and arm r1 stand as for all recordings of this camera position: the camera level, towards arm r2."
    if row is None:
        yield "Arm r2 holds no garment, and stays wholly out of the camera's view."
        return
    yield "The garment hangs from the gripper of arm r2, in the camera's view, and has come to rest."
    angle = "" if row.swing_rad is None else f" by pi/{row.name.swing_divisor}"
    way = "along" if row.axis == "R" else "across"
    yield (
        f"Start the recording; a second later turn axis {row.axis} of arm r2{angle} and back, at speed"
        f" {row.name.speed}: the garment moves {way} the optical axis."
    )
    if row.axis == "B":
        yield _about_background(row, catalog.background(row.topics_file))


def _about_background(row: CatalogRow, background: BackgroundSource) -> str:
    if background.source == row.recording:
        return f"Keep the scene empty at its time: it is its own background ({background})."
    if background.path is None:
        command = f"garment record-plan {shlex.quote(background.source)}"
        return f"Record its empty scene, too, before anything is moved: {command}"
    return f"Its empty scene is there ({background}): see that camera and turntable have not been moved since."


def _afterwards(catalog: Catalog, row: CatalogRow | None, path: Path) -> Iterator[str]:
    """Yield the commands that tell whether the bag is good, use it, and plan its other half."""
    made = path if row is None or row.path is None else row.path
    yield f"garment check {shlex.quote(str(made))}"
    yield f"garment lint {shlex.quote(path.stem)}"
    if row is None:
        yield f"garment build axis=B topics_file={catalog.scheme.parse(path.stem).topics_file}"
        return
    yield f"garment build {shlex.quote(row.recording)}"
    partner = next((other for other in catalog.rows if other.recording == row.partner), None)
    if partner is not None and partner.path is None:
        yield f"garment record-plan {shlex.quote(partner.recording)}"

"""Drill: whatever stands in the files of a person, a command works, or says in one line which file is wrong.

Never another exception, never a hang. Everything is drawn from seeds: a case that fails is made again by its number.
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import re
import shutil
import signal
import sys
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import typer

from garment_dataset.catalog import Catalog
from garment_dataset.catalog.lint import lint
from garment_dataset.cli import catalog as verbs
from garment_dataset.cli import status
from garment_dataset.cli.lint import lint_
from garment_dataset.cli.streams import make_streams_safe
from garment_dataset.errors import DataWarning, GarmentError
from garment_dataset.layout import Layout
from garment_dataset.workspace.known_stages import KnownStages
from garment_dataset.workspace.pipelines import load_pipelines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

TIME_LIMIT_S = 20.0
NAMES = (
    "GreenTowel_Free_pi16_0.5_R1",
    "GreenTowel_Corner_01_pi16_0.5_B1",
    "MyScarf_Free_pi16_1_R2",
    "camera_default_0",
)
VICTIMS = (
    "catalog/garments.csv",
    "catalog/holdings.csv",
    "catalog/recordings.csv",
    "catalog/backgrounds.csv",
    "catalog/columns.toml",
    "catalog/topics/1.txt",
    "recordings/.garmentignore",
    "pipelines/depth.toml",
    "pipelines/colour.toml",
    "garment.toml",
)
SETTINGS = '[paths]\nfeatures = "results"\nrecordings = "recordings"\n\n[stages]\nmodules = []\n'


COLUMNS = '[mass_kg]\ntype = "number"\nunit = "kg"\n\n[day]\ntype = "date"\ndescription = "of the recording"\n'


class HangError(Exception):
    """A case that took too long."""


@contextlib.contextmanager
def time_limit() -> Iterator[None]:
    def stop(_: int, __: FrameType | None) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, TIME_LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


# What is done to the bytes of a file


def flip_bits(draw: random.Random, data: bytes) -> bytes:
    changed = bytearray(data or b"x")
    for _ in range(draw.choice([1, 1, 2, 8, 64])):
        changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
    return bytes(changed)


def set_bytes(draw: random.Random, data: bytes) -> bytes:
    changed = bytearray(data or b"x")
    for _ in range(draw.choice([1, 3, 20])):
        changed[draw.randrange(len(changed))] = draw.choice([0, 9, 10, 13, 34, 39, 44, 59, 61, 91, 92, 127, 128, 255])
    return bytes(changed)


def truncate(draw: random.Random, data: bytes) -> bytes:
    return data[: draw.randrange(len(data) + 1)]


def encode_anew(draw: random.Random, data: bytes) -> bytes:
    encoding = draw.choice(["utf-16", "utf-16-le", "utf-32", "latin-1", "utf-8-sig", "cp037", "utf-7"])
    return ("é" + data.decode("utf-8")).encode(encoding) if draw.random() < 0.5 else data.decode().encode(encoding)


def put_in(draw: random.Random, data: bytes, *texts: str) -> bytes:
    place = draw.randrange(len(data) + 1)
    return data[:place] + draw.choice(texts).encode("utf-8", "surrogatepass") + data[place:]


def put_odd_letters(draw: random.Random, data: bytes) -> bytes:
    odd = ("\0", "\r", "\r\n", "\n\n", '"', "'", '""', "\x1b[31m", "\u2028", "\u202e", "\x85", "\ud800", "雨", "\ufeff")
    return put_in(draw, data, *odd, "%s", "{0}", "*", "[", "?", "\\", "../..", "/etc", "#", "=")


def put_long_text(draw: random.Random, data: bytes) -> bytes:
    return put_in(draw, data, "x" * 1000, "y" * 200_000, "a," * 50_000, "_1" * 5000, "\n" * 5000, " " * 100_000)


def put_numbers(draw: random.Random, data: bytes) -> bytes:
    odd = ("nan", "inf", "-inf", "1e999", "-1e999", "9" * 400, "9" * 5000, "0x10", "1_000", "-0", "1e-400", "٣", "²")
    fields = [found.span() for found in re.finditer(rb"[0-9.]+", data)]
    if not fields or draw.random() < 0.3:
        return put_in(draw, data, *odd)
    begin, end = draw.choice(fields)
    return data[:begin] + draw.choice(odd).encode() + data[end:]


def twice(draw: random.Random, data: bytes) -> bytes:
    lines = data.splitlines(keepends=True) or [b"x\n"]
    line = draw.choice(lines)
    times = draw.choice([1, 1, 3, 300])
    return b"".join([*lines, *[line] * times]) if draw.random() < 0.7 else b"".join([*[line] * times, *lines])


def twice_in_a_row(draw: random.Random, data: bytes) -> bytes:
    lines = [line.split(b",") for line in data.split(b"\n")]
    column = draw.randrange(len(lines[0]))
    return b"\n".join(b",".join([*cells, *cells[column : column + 1]]) for cells in lines)


def separate_anew(draw: random.Random, data: bytes) -> bytes:
    old, new = draw.choice([(b",", b";"), (b",", b"\t"), (b"\n", b"\r"), (b"\n", b","), (b'"', b"'"), (b"=", b":")])
    return data.replace(old, new) if draw.random() < 0.7 else data.replace(old, new, draw.randrange(1, 9))


def retype(draw: random.Random, data: bytes) -> bytes:
    values = (b"1", b"true", b"1.5", b'"x"', b"[]", b"{}", b"[1, [2]]", b"1979-05-27", b'["", 1]', b"{a = {b = 1}}")
    fields = [found.span(1) for found in re.finditer(rb"(?:=|,|\n)[ ]*([^,\n=]*)", data)]
    begin, end = draw.choice(fields or [(0, len(data))])
    return data[:begin] + draw.choice(values) + data[end:]


def nest(draw: random.Random, data: bytes) -> bytes:
    depth = draw.choice([5, 50, 500, 5000, 50_000])
    texts = (
        "\nx = " + "[" * depth + "]" * depth,
        "\nstages = " + "[" * depth,
        "\n[" + ".".join(["params"] * depth) + "]\n",
        "\nx = " + "{a = " * depth + "1" + "}" * depth,
        "\n[params.decode]\n" + ".".join(["a"] * depth) + " = 1",
    )
    return data + draw.choice(texts).encode()


def reorder(draw: random.Random, data: bytes) -> bytes:
    lines = data.splitlines(keepends=True)
    draw.shuffle(lines)
    return b"".join(lines[: draw.randrange(len(lines) + 1)])


def misspell(draw: random.Random, data: bytes) -> bytes:
    words = [found.span() for found in re.finditer(rb"[A-Za-z_]{3,}", data)]
    begin, end = draw.choice(words or [(0, len(data))])
    word = bytearray(data[begin:end] or b"x")
    place = draw.randrange(len(word))
    word[place : place + 1] = draw.choice(
        [b"", b"x", bytes(word[place : place + 1] * 2), word[place : place + 1].upper()]
    )
    return data[:begin] + bytes(word) + data[end:]


EDITS: tuple[Callable[[random.Random, bytes], bytes], ...] = (
    *(flip_bits, set_bytes, truncate, encode_anew, put_odd_letters, put_long_text, put_numbers, twice),
    *(twice_in_a_row, separate_anew, retype, nest, reorder, misspell),
)


# What is done to a file as a whole


def be_a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()
    (path / "x.bag").touch()


def be_a_link_to(target: str) -> Callable[[Path], None]:
    def replace(path: Path) -> None:
        path.unlink()
        path.symlink_to(path.name if target == "itself" else target)

    return replace


def be_a_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def be_unreadable(path: Path) -> None:
    path.chmod(0)


def be_away(path: Path) -> None:
    path.unlink()


KINDS: tuple[Callable[[Path], None], ...] = (
    *(be_a_folder, be_a_pipe, be_unreadable, be_away),
    *(be_a_link_to(target) for target in ("nowhere", "itself", "/dev/zero", "/dev/null", "..", "/")),
)


# What lies in the folder of recordings


def odd_name(draw: random.Random) -> bytes:
    letters = [*b"GreenTowel_Corner_01_pi16_0.5_R1-", 10, 13, 27, 32, 34, 44, 91, 42, 195, 164, 255, 128, 37, 92]
    name = bytes(draw.choice(letters) for _ in range(draw.choice([1, 5, 30, 250])))
    if draw.random() < 0.5:
        base = draw.choice(NAMES).encode()
        place = draw.randrange(len(base) + 1)
        name = base[:place] + name[: draw.randrange(4)] + base[place + draw.randrange(2) :]
    return name[:240] + draw.choice([b".bag", b".bag", b".bag.active", b".BAG", b".db3", b".mcap", b"", b".bag.bag"])


def put_odd_entry(draw: random.Random, folder: Path) -> str:
    path = os.path.join(os.fsencode(folder), odd_name(draw))  # noqa: PTH118 - bytes
    kind = draw.choice(["file", "file", "folder", "link", "loop", "pipe", "bag2", "closed"])
    with contextlib.suppress(FileExistsError):
        if kind in {"folder", "bag2", "closed"}:
            os.mkdir(path)  # noqa: PTH102
            if kind == "bag2":
                Path(os.fsdecode(path), "metadata.yaml").touch()
            if kind == "closed":
                Path(os.fsdecode(path)).chmod(0)
        elif kind == "pipe":
            os.mkfifo(path)
        elif kind in {"link", "loop"}:
            target = path if kind == "loop" else draw.choice([b"nowhere", b"..", b"/dev/zero", b"."])
            Path(os.fsdecode(path)).symlink_to(os.fsdecode(target))
        else:
            Path(os.fsdecode(path)).touch(exist_ok=False)
    return f"{kind} {path!r}"


# The law


@dataclass
class Outcome:
    """What became of each call of a case: "works", or the class of the error that a person sees."""

    counts: Counter[str]


def called(layout_root: Path) -> dict[str, Callable[[], object]]:
    """Return everything that reads the files of a person; each call stands alone."""

    def find() -> Layout:
        return Layout.find(layout_root)

    def loaded(*, strict: bool) -> Catalog:
        layout = find()
        return Catalog.of(layout, strict=strict)

    def pipelines() -> object:
        return load_pipelines(find().pipelines_dir, KnownStages.of(find()))

    def topics() -> object:
        catalog = loaded(strict=False)
        return [catalog.topics(row.topics_file) for row in catalog.rows], catalog.backgrounds

    return {
        "Layout.find": find,
        "Catalog.load": lambda: loaded(strict=True),
        "Catalog.query": lambda: loaded(strict=False).query("*_R1", "weight_kg>0.01", state=["present", "missing"]),
        "Catalog.topics": topics,
        "lint": lambda: lint(loaded(strict=False)),
        "load_pipelines": pipelines,
        "garment list": lambda: verbs.list_(["axis=R", "*_1_*"], layout_root, as_json=False, as_csv=True),
        "garment list --json": lambda: verbs.list_(None, layout_root, as_json=True, as_csv=False),
        "garment lint": lambda: lint_(None, layout_root, as_json=False),
        "garment dag": lambda: status.dag(status.DagForm.TEXT, params=True, workspace=layout_root, as_json=False),
        "garment status": lambda: status.status(None, None, layout_root, as_json=False, exit_code=False),
    }


@contextlib.contextmanager
def as_a_terminal() -> Iterator[None]:
    """Let commands write as they do on a terminal in UTF-8, as ``main`` prepares it."""
    out = io.TextIOWrapper(io.BytesIO(), "utf-8", errors="strict")
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        make_streams_safe()
        yield
        sys.stdout.flush()
        sys.stderr.flush()


def hold_to_law(root: Path, outcome: Outcome, calls: Callable[[str], bool] = lambda _: True) -> None:
    known = {Path(name).name for name in VICTIMS} | {str(root)}
    for name, call in called(root).items():
        if not calls(name):
            continue
        try:
            with time_limit(), as_a_terminal(), warnings.catch_warnings(record=True) as noticed:
                warnings.simplefilter("always")
                call()
        except GarmentError as error:
            text = str(error)
            assert len(text.splitlines()) == 1, (name, text)
            assert text.isprintable(), (name, text)
            assert any(word in text for word in known), f"{name} names no file: {text}"
            assert len(text) < 2500, (name, text)
            outcome.counts[type(error).__name__] += 1
        except typer.Exit:
            outcome.counts["works"] += 1
        else:
            outcome.counts["works"] += 1
        assert {warning.category for warning in noticed} <= {DataWarning}, (name, noticed[0].message)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace in which everything is sound."""
    layout = Layout.create(tmp_path_factory.mktemp("drill") / "sound")
    for name in NAMES:
        (layout.recordings_dir / f"{name}.bag").write_bytes(b"#ROSBAG V2.0\n")
    (layout.root / "garment.toml").write_text(SETTINGS, "utf-8")
    garments = layout.catalog_dir / "garments.csv"
    lines = garments.read_text("utf-8").splitlines()
    garments.write_text(
        "\n".join([f"{lines[0]},mass_kg,day", *(f"{line},0.5,2026-11-25" for line in lines[1:])]), "utf-8"
    )
    (layout.catalog_dir / "columns.toml").write_text(COLUMNS, "utf-8")
    (layout.recordings_dir / ".garmentignore").write_text("# none\ntrial_[a-c]*/**/x?.bag\n!old/\n", "utf-8")
    outcome = Outcome(Counter())
    hold_to_law(layout.root, outcome)
    assert set(outcome.counts) == {"works"}
    return layout.root


@contextlib.contextmanager
def copy_of(sound: Path, place: Path) -> Iterator[Path]:
    shutil.copytree(sound, place, symlinks=True)
    try:
        yield place
    finally:
        shutil.rmtree(place)


def damaged_text(seed: int, root: Path) -> str:
    """Damage one file's bytes, as a seed says; return what was done."""
    draw = random.Random(seed)
    victim = draw.choice(VICTIMS)
    path, done = root / victim, []
    data = path.read_bytes()
    for _ in range(draw.choice([1, 1, 1, 2, 4])):
        edit = draw.choice(EDITS)
        with contextlib.suppress(UnicodeDecodeError, UnicodeEncodeError):
            data = edit(draw, data)
            done.append(edit.__name__)
    path.write_bytes(data)
    return f"seed {seed}: {victim}: {', '.join(done)}"


def drill(sound: Path, place: Path, seeds: range, *, slow_calls: bool) -> Outcome:
    outcome = Outcome(Counter())
    with copy_of(sound, place) as root:
        kept = {victim: (root / victim).read_bytes() for victim in VICTIMS}
        for seed in seeds:
            what = damaged_text(seed, root)
            heavy = slow_calls or seed % 5 == 0
            try:
                hold_to_law(root, outcome, lambda name, heavy=heavy: heavy or name != "garment status")  # type: ignore[misc]
            except BaseException as error:
                error.add_note(what)
                raise
            for victim, data in kept.items():
                (root / victim).write_bytes(data)
    return outcome


def test_damaged_text_is_read_or_refused_in_one_line(sound: Path, tmp_path: Path) -> None:
    outcome = drill(sound, tmp_path / "ws", range(100), slow_calls=False)
    assert outcome.counts["works"] > 100
    assert min(outcome.counts[kind] for kind in ("CatalogError", "PipelineError", "WorkspaceError")) > 10


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_much_damaged_text_is_read_or_refused_in_one_line(sound: Path, tmp_path: Path, part: int) -> None:
    drill(sound, tmp_path / "ws", range(1000 * (part + 1), 1000 * (part + 2)), slow_calls=True)


@pytest.mark.parametrize("victim", VICTIMS)
def test_what_is_no_file_is_refused_in_one_line(sound: Path, tmp_path: Path, victim: str) -> None:
    for number, change in enumerate(KINDS):
        with copy_of(sound, tmp_path / f"{number}") as root:
            change(root / victim)
            hold_to_law(root, Outcome(Counter()))


@pytest.mark.parametrize("folder", ["catalog", "catalog/topics", "pipelines", "recordings", ".garment", "results"])
def test_what_is_no_folder_is_refused_in_one_line(sound: Path, tmp_path: Path, folder: str) -> None:
    # of a private folder that may not be read, the engine's store says so with a traceback
    kinds = ["file", "away", "nowhere", "itself", *(["closed"] if folder != ".garment" else [])]
    for number, kind in enumerate(kinds):
        with copy_of(sound, tmp_path / f"{number}") as root:
            path = root / folder
            shutil.rmtree(path, ignore_errors=True)
            if kind == "file":
                path.write_text("x")
            elif kind == "closed":
                path.mkdir(0)
            elif kind != "away":
                path.symlink_to(path.name if kind == "itself" else kind)
            hold_to_law(root, Outcome(Counter()))
            if kind == "closed":
                path.chmod(0o700)


@pytest.mark.parametrize("seed", range(3))
def test_a_damaged_result_is_refused_in_one_line(sound: Path, tmp_path: Path, seed: int) -> None:
    """``garment list`` reads one table of results."""
    with copy_of(sound, tmp_path / "ws") as root:
        path = root / "results" / "quality" / "garment=GreenTowel" / f"{NAMES[0]}.parquet"
        path.parent.mkdir(parents=True)
        path.write_bytes(random.Random(seed).choice([b"", b"PAR1", random.Random(seed).randbytes(5000)]))
        outcome = Outcome(Counter())
        hold_to_law(root, outcome, lambda name: "list" in name)
        assert outcome.counts == {"StoreError": 2}


def odd_recordings(sound: Path, place: Path, seeds: range) -> None:
    with copy_of(sound, place) as root:
        for seed in seeds:
            draw = random.Random(seed)
            folder = root / "recordings" / f"{seed}"
            folder.mkdir()
            done = [put_odd_entry(draw, folder) for _ in range(draw.choice([1, 2, 5]))]
            try:
                hold_to_law(root, Outcome(Counter()), lambda name: "status" not in name and "pipe" not in name)
            except BaseException as error:
                error.add_note(f"seed {seed}: {done}")
                raise
            for path in folder.iterdir():
                if path.is_dir() and not path.is_symlink():
                    path.chmod(0o700)
            shutil.rmtree(folder)


def test_odd_names_among_the_recordings(sound: Path, tmp_path: Path) -> None:
    odd_recordings(sound, tmp_path / "ws", range(60))


@pytest.mark.slow
def test_many_odd_names_among_the_recordings(sound: Path, tmp_path: Path) -> None:
    odd_recordings(sound, tmp_path / "ws", range(1000, 3000))


def test_the_law_can_be_broken(sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error that is not a person's, one of two lines, one without a file: each is found."""

    class TwoLinesError(GarmentError):
        def __str__(self) -> str:
            return f"{sound}\ntwo lines"

    for error in (KeyError("x"), TwoLinesError("x"), GarmentError("no file")):

        def broken(_: object = None, error: Exception = error) -> Layout:
            raise error

        with monkeypatch.context() as patch:
            patch.setattr(Layout, "find", broken)
            with pytest.raises((KeyError, AssertionError)):
                hold_to_law(sound, Outcome(Counter()))

"""``garment doctor``: it tells what is odd about a machine and a workspace, changes nothing, and never fails itself."""

from __future__ import annotations

import errno
import json
import locale
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from garment_dataset import doctor
from garment_dataset.cli import application
from garment_dataset.doctor import folders, machine, software
from garment_dataset.doctor.check import Check, guarded
from garment_dataset.layout import Layout

Monkey = pytest.MonkeyPatch


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    return Layout.create(tmp_path / "ws")


def states(checks: Iterable[Check]) -> dict[str, str]:
    return {check.name: check.state for check in checks}


def run(*arguments: str) -> tuple[int, str, str]:
    done = CliRunner().invoke(application(), ["doctor", *arguments], catch_exceptions=False)
    return done.exit_code, done.stdout, done.stderr


def everything(folder: Path) -> dict[str, bytes | None]:
    return {str(path): path.read_bytes() if path.is_file() else None for path in sorted(folder.rglob("*"))}


# The command


def test_a_new_workspace_on_this_machine_has_no_fault_and_is_left_as_it_was(layout: Layout) -> None:
    (layout.recordings_dir / "GreenTowel_Free_pi16_0.5_R1.bag").write_bytes(bytes(5000))
    before = everything(layout.root)
    code, out, err = run("-w", str(layout.root))
    assert code == 0, out
    assert everything(layout.root) == before
    lines = out.splitlines()
    assert all(line.startswith(("ok ", "warning ")) for line in lines)
    assert any("recordings: 1 bags, 5 kB" in line for line in lines)
    assert err.splitlines()[-1].endswith("0 fault")


def test_outside_of_a_workspace_the_machine_is_checked(tmp_path: Path, monkeypatch: Monkey) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GARMENT_WORKSPACE", raising=False)
    code, out, _ = run("--json")
    report = json.loads(out)
    names = [check["name"] for check in report["checks"]]
    assert code == 0
    assert report["workspace"] is None
    assert {"python", "numpy", "opencv", "space, temporary folder"} <= set(names)
    assert "links" not in names
    assert list(tmp_path.iterdir()) == []


def test_a_workspace_that_cannot_be_read_is_a_fault_and_hides_nothing_else(layout: Layout) -> None:
    (layout.root / "garment.toml").write_text("[path]\n")
    code, out, _ = run("-w", str(layout.root), "--json")
    checks = {check["name"]: check for check in json.loads(out)["checks"]}
    assert code == 1
    assert checks["workspace"]["state"] == "fault"
    assert "Did you mean paths?" in checks["workspace"]["text"]
    assert checks["numpy"]["state"] == "ok"


def test_every_check_is_guarded(layout: Layout, monkeypatch: Monkey) -> None:
    """Take away, one after the other, what the checks stand on: whatever breaks, a line says so."""

    def broken(*_: object, **__: object) -> Any:
        raise OSError(errno.EIO, "Input/output\nerror")

    whole = len(doctor.examine(layout))
    for owner, name in [
        (os, "stat"),
        (shutil, "disk_usage"),
        (tempfile, "NamedTemporaryFile"),
        (tempfile, "TemporaryDirectory"),
        (metadata, "version"),
        (metadata, "requires"),
        (metadata, "metadata"),
        (machine, "usable_cpus"),
        (folders, "scan"),
        (Path, "iterdir"),
    ]:
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, broken)
            found = doctor.examine(layout)
        assert found, name
        assert {check.state for check in found} & {"warning", "fault"}, name
        assert all("\n" not in str(check) for check in found), name
    assert len(doctor.examine(layout)) == whole


def test_a_check_that_fails_keeps_what_it_had_found() -> None:
    def half() -> Iterable[Check]:
        yield Check("a", "ok", "fine")
        raise ZeroDivisionError("by nought")

    assert [str(check) for check in guarded("b", half)] == [
        "ok       a: fine",
        "warning  b: cannot be checked: ZeroDivisionError: by nought",
    ]


# Versions


@pytest.mark.parametrize(
    ("version", "lowest", "expected"),
    [
        ("1.26", "1.26", False),
        ("1.26.0", "1.26", False),
        ("1.26", "1.26.0", False),
        ("1.9", "1.26", True),
        ("2.0rc1", "1.26", False),
        ("10", "9.99", False),
        ("v3.1.post2", "3.2", True),
        ("1!2.0", "1.9", False),
        ("5.0.0.93", "4.9", False),
        ("0.1", None, False),
    ],
)
def test_versions_compare_by_their_numbers(version: str, lowest: str | None, expected: bool) -> None:
    assert software.is_older(version, lowest) is expected


@given(st.lists(st.integers(0, 99), min_size=1), st.lists(st.integers(0, 99), min_size=1))
def test_versions_compare_as_tuples_do(a: list[int], b: list[int]) -> None:
    length = max(len(a), len(b))
    padded = [[*numbers, *[0] * (length - len(numbers))] for numbers in (a, b)]
    assert software.is_older(".".join(map(str, a)), ".".join(map(str, b))) is (padded[0] < padded[1])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("numpy>=1.26", ("numpy", "1.26", None)),
        ("numpy (>=1.26,<3)", ("numpy", "1.26", None)),
        ("pandas-stubs; extra == 'dev'", ("pandas-stubs", None, "dev")),
        ('mujoco>=4; extra == "simulate"', ("mujoco", "4", "simulate")),
        ("rich[jupyter]~=13.7 ; python_version < '4' and extra == 'x'", ("rich", "13.7", "x")),
    ],
)
def test_requirements_are_read(text: str, expected: tuple[str, str | None, str | None]) -> None:
    assert software.parse_requirement(text) == expected


def test_what_is_too_old_or_not_there_is_a_fault_unless_it_is_extra(monkeypatch: Monkey) -> None:
    asked = ["aa>=2", "bb>=2", "cc", "dd>=1; extra == 'e'", "ff>=3; extra == 'g'"]
    there = {"aa": "1.9", "cc": "0", "ff": "2"}
    monkeypatch.setattr(metadata, "requires", lambda _: asked)
    monkeypatch.setattr(software, "installed", there.get)
    assert states(software.dependencies()) == {"aa": "fault", "bb": "fault", "cc": "ok"}
    assert states(software.extras()) == {"extra e": "ok", "extra g": "warning"}
    texts = [str(check) for check in (*software.dependencies(), *software.extras())]
    assert texts[1] == "fault    bb: not installed (needs >= 2). pip install 'bb>=2'."
    assert "not installed: dd. pip install --upgrade 'garment-dataset[e]' brings it." in texts[3]


@pytest.mark.parametrize(
    ("builds", "module", "state", "text"),
    [
        ({"opencv-python-headless": "5"}, True, "ok", "opencv-python-headless 5"),
        ({"opencv-python": "5"}, True, "warning", "not the headless build"),
        ({"opencv-python": "5", "opencv-python-headless": "4"}, True, "fault", "2 builds at once"),
        ({"opencv-python-headless": "5"}, False, "fault", "no module cv2, although there is"),
        ({}, False, "fault", "no module cv2"),
        ({}, True, "warning", "the system's own"),
    ],
)
def test_builds_of_opencv(monkeypatch: Monkey, builds: Mapping[str, str], module: bool, state: str, text: str) -> None:
    monkeypatch.setattr(software, "installed", builds.get)
    monkeypatch.setattr(software, "find_spec", lambda _: object() if module else None)
    (check,) = software.opencv()
    assert check.state == state
    assert text in check.text


def test_another_build_of_opencv_is_no_missing_dependency(monkeypatch: Monkey) -> None:
    monkeypatch.setattr(metadata, "requires", lambda _: ["opencv-python-headless>=4.9"])
    monkeypatch.setattr(software, "installed", {"opencv-python": "5"}.get)
    assert list(software.dependencies()) == []


def test_packages_of_ros_on_the_path_are_said(monkeypatch: Monkey) -> None:
    assert states(software.ros()) == {"ros": "ok"}
    monkeypatch.setattr(sys, "path", ["/opt/ros/noetic/lib/python3/dist-packages"])
    assert states(software.ros()) == {"ros": "warning"}


# The machine


def test_a_container_that_allows_less_is_said(tmp_path: Path, monkeypatch: Monkey) -> None:
    monkeypatch.setattr(machine, "usable_cpus", lambda: 8)
    (tmp_path / "meminfo").write_text("MemTotal: 64000000 kB\nMemAvailable: 32000000 kB\nHugePages_Total: 0\n")
    info = tmp_path / "meminfo"
    assert states(machine.processors(tmp_path)) == {"processors": "ok"}
    assert states(machine.memory(tmp_path, info)) == {"memory": "ok"}
    (tmp_path / "cpu.max").write_text("150000 100000\n")
    (tmp_path / "memory.max").write_text("2000000000\n")
    (cpus,), (space,) = machine.processors(tmp_path), machine.memory(tmp_path, info)
    assert (cpus.state, cpus.hint) == ("warning", "`garment build --jobs 2`.")
    assert "1.5 at a time" in cpus.text
    assert (space.state, space.hint) == ("warning", "`garment build --jobs 4` if it is killed.")
    (tmp_path / "cpu.max").write_text("max 100000\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert states(machine.processors(tmp_path)) == {"processors": "ok"}
    assert states(machine.memory(tmp_path, info)) == {"memory": "ok"}


def test_the_older_form_of_limits_is_read(tmp_path: Path, monkeypatch: Monkey) -> None:
    monkeypatch.setattr(machine, "usable_cpus", lambda: 4)
    (tmp_path / "cpu").mkdir()
    (tmp_path / "cpu/cpu.cfs_quota_us").write_text("-1")
    (tmp_path / "cpu/cpu.cfs_period_us").write_text("100000")
    assert states(machine.processors(tmp_path)) == {"processors": "ok"}
    (tmp_path / "cpu/cpu.cfs_quota_us").write_text("200000")
    assert states(machine.processors(tmp_path)) == {"processors": "warning"}


@pytest.mark.parametrize(("now_s", "state"), [(0, "fault"), (1_800_000_000, "ok"), (9e9, "fault")])
def test_a_clock_that_cannot_be_right_is_a_fault(now_s: float, state: str) -> None:
    assert states(machine.year(now_s)) == {"year": state}


def test_text_that_is_not_utf_8_is_said(monkeypatch: Monkey) -> None:
    monkeypatch.setattr(sys, "stdout", SimpleNamespace(encoding="utf_8"))
    monkeypatch.setattr(locale, "getpreferredencoding", lambda **_: "UTF-8")
    assert states(machine.encoding()) == {"encoding": "ok"}
    monkeypatch.setattr(sys, "stdout", SimpleNamespace(encoding="ascii"))
    (check,) = machine.encoding()
    assert check.state == "warning"
    assert check.text.endswith("output not UTF-8")


# Folders


def test_little_space_is_told_from_none(layout: Layout, monkeypatch: Monkey) -> None:
    path = layout.recordings_dir / "GreenTowel_Free_pi16_0.5_R1.bag"
    with path.open("wb") as file:
        file.truncate(50_000_000_000)  # a hole
    for free_bytes, own, temporary in ((6e9, "ok", "ok"), (4e9, "warning", "ok"), (0.5e9, "warning", "warning")):
        free = SimpleNamespace(free=free_bytes)
        monkeypatch.setattr(shutil, "disk_usage", lambda _, free=free: free)
        found = states(folders.space(layout))
        assert found["space, features folder"] == found["space, private folder"] == own
        assert found["space, temporary folder"] == temporary
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=1e6))
    assert set(states(folders.space(layout)).values()) == {"fault"}


def test_links_are_tried_and_what_is_made_is_removed(layout: Layout, monkeypatch: Monkey) -> None:
    layout.private_dir.mkdir()
    layout.features_dir.mkdir()
    before = everything(layout.root)
    here = folders.linked_by(layout.private_dir, layout.features_dir)
    assert here in {"reflink", "hard link", "copy"}

    def refused(*_: object) -> None:
        raise OSError(errno.EXDEV, "Cross-device link")

    monkeypatch.setattr(Path, "hardlink_to", refused)
    if here != "reflink":
        assert folders.linked_by(layout.private_dir, layout.features_dir) == "copy"
        (check,) = folders.links(layout)
        assert check.state == "warning"
        assert "on one file system: copies" in check.text
    assert everything(layout.root) == before


def test_permissions_are_tried(layout: Layout, monkeypatch: Monkey) -> None:
    found = states(folders.permissions(layout))
    assert set(found.values()) == {"ok"}
    layout.recordings_dir.rmdir()
    assert states(folders.permissions(layout))["recordings folder"] == "warning", "it may be a disk that is not there"
    shutil.rmtree(layout.pipelines_dir)
    assert states(folders.permissions(layout))["pipelines folder"] == "fault"

    def refused(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(tempfile, "NamedTemporaryFile", refused)
    found = states(folders.permissions(layout))
    assert (found["private folder"], found["features folder"]) == ("fault", "fault")


def test_published_files_that_can_be_written_to_are_said(layout: Layout) -> None:
    path = layout.features_dir / "points" / "a.parquet"
    path.parent.mkdir(parents=True)
    path.touch(0o444)
    assert states(folders.permissions(layout))["published files"] == "ok"
    path.chmod(0o644)
    assert states(folders.permissions(layout))["published files"] == "warning"


def test_bags_that_cannot_be_read_are_a_fault(layout: Layout, monkeypatch: Monkey) -> None:
    (layout.recordings_dir / "a.bag").touch()
    (layout.recordings_dir / "b.bag").symlink_to("nowhere")
    (check,) = folders.bags(layout)
    assert check.state == "warning"
    assert "a link to nothing" in check.text
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert states(folders.bags(layout)) == {"recordings": "fault"}


@pytest.mark.parametrize(("step_ns", "state"), [(1, "ok"), (1000, "ok"), (10**9, "warning"), (2 * 10**9, "warning")])
def test_coarse_time_stamps_are_said(layout: Layout, monkeypatch: Monkey, step_ns: int, state: str) -> None:
    exact: Callable[..., None] = os.utime

    def coarse(path: str, ns: tuple[int, int]) -> None:
        exact(path, ns=(ns[0] // step_ns * step_ns, ns[1] // step_ns * step_ns))

    monkeypatch.setattr(os, "utime", coarse)
    assert states(folders.stamps(layout)) == {"time stamps": state}
    assert folders.kept_ns(layout.root) <= 10 * step_ns


def test_letter_case_that_does_not_count_is_said(layout: Layout, monkeypatch: Monkey) -> None:
    assert states(folders.case(layout)) == {"letter case": "ok"}
    exact = Path.exists
    monkeypatch.setattr(Path, "exists", lambda path: exact(Path(str(path).replace("doctor-A", "doctor-a"))))
    assert states(folders.case(layout)) == {"letter case": "warning"}


def test_files_of_the_future_are_said(layout: Layout) -> None:
    newest_s = max(path.stat().st_mtime for path in layout.root.rglob("*"))
    assert states(folders.clock(layout, newest_s + 1)) == {"clock": "ok"}
    (check,) = folders.clock(layout, newest_s - 10 * 86400)
    assert check.state == "warning"
    assert "10 days from now" in check.text

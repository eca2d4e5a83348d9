"""How a recording is made: the recorder's commands word by word, and what is refused before anybody records."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_dataset.catalog import Catalog
from garment_dataset.catalog.hints import nearest_names
from garment_dataset.catalog.record_plan import RecordPlan, plan_recording
from garment_dataset.errors import CatalogError, UsageError
from garment_dataset.layout import packaged_workspace

DEPTH, COLOR = "GreenTowel_Corner_01_pi16_0.5_R1", "GreenTowel_Corner_01_pi16_0.5_B1"


@pytest.fixture
def tables(tmp_path: Path) -> Path:
    """A copy of the thesis' tables."""
    return Path(shutil.copytree(packaged_workspace() / "catalog", tmp_path / "catalog"))


@pytest.fixture
def bags(tmp_path: Path) -> Path:
    """A folder without bags, whose name a shell would take apart."""
    folder = tmp_path / "my bags; $HOME"
    folder.mkdir()
    return folder


def plan(tables: Path, bags: Path, name: str) -> RecordPlan:
    return plan_recording(Catalog.load(tables).with_folder(bags), name)


def list_recording(tables: Path, name: str) -> None:
    with (tables / "recordings.csv").open("a") as file:
        file.write(f"{name},,,,,\n")


def test_the_commands_name_duration_file_and_topics(tables: Path, bags: Path) -> None:
    found = plan(tables, bags, DEPTH)
    topics = (tables / "topics" / "1.txt").read_text().split()
    assert len(topics) == 10
    assert list(found.ros1) == ["rosbag", "record", "--duration=8", "-O", str(bags / f"{DEPTH}.bag"), *topics]
    stopped = ["timeout", "--signal=INT", "8"]
    assert list(found.ros2) == [*stopped, "ros2", "bag", "record", "-o", str(bags / DEPTH), *topics]


def test_a_shell_takes_a_command_for_what_it_is(tables: Path, bags: Path) -> None:
    found = plan(tables, bags, DEPTH).record()["commands"]
    assert isinstance(found, dict)
    echoed = subprocess.run(["sh", "-c", f"printf '%s\\n' {found['ros1']}"], check=True, capture_output=True, text=True)
    assert echoed.stdout.splitlines() == list(plan(tables, bags, DEPTH).ros1)


def test_a_name_in_any_form_is_written_as_it_should_be(tables: Path, bags: Path) -> None:
    assert plan(tables, bags, "FelShirt_Free_pi16.0.5_B1.bag").path == bags / "FelShirt_Free_pi16_0.5_B1.bag"


def test_the_topics_file_of_the_name_is_taken_and_the_usual_one_stands_in(tables: Path, bags: Path) -> None:
    name = "MyScarf_Corner_pi16_0.5_R2"
    list_recording(tables, name)
    usual = plan(tables, bags, name)
    assert usual.topics_path.name == "1.txt"
    assert usual.notes == ("there is no topics file 2.txt: these are the topics of 1.txt",)
    (tables / "topics" / "2.txt").write_text("/tf\n/camera/depth\n")
    own = plan(tables, bags, name)
    assert (own.topics, own.notes) == (("/tf", "/camera/depth"), ())


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "without topics"),
        (b"# depth\n/tf\n", "Comments"),
        (b"/tf\ncamera/depth\n", "word 2"),
        (b"/tf/\n", "not a topic"),
        (b"/tf;reboot\n", "not a topic"),
        (b"--all\n", "not a topic"),
        (b"/tf,/joint_states\n", "not a topic"),
        ("/tf\n/größe\n".encode(), "not a topic"),
        (b"/tf\x00\n", "a zero byte in line 1"),
        (b"/tf\n/joint_states\n/tf\n", "given twice"),
        (b"\xff\xfe/\x00t\x00f\x00", "UTF-8"),
    ],
)
def test_odd_topics_are_refused_in_one_line(tables: Path, bags: Path, content: bytes, message: str) -> None:
    (tables / "topics" / "1.txt").write_bytes(content)
    with pytest.raises(CatalogError, match=message) as refused:
        plan(tables, bags, DEPTH)
    assert len(str(refused.value).splitlines()) == 1
    assert "1.txt" in str(refused.value)


def test_a_catalog_without_topics_says_what_to_write(tables: Path, bags: Path) -> None:
    shutil.rmtree(tables / "topics")
    with pytest.raises(CatalogError, match="no such topics file"):
        plan(tables, bags, DEPTH)
    (tables / "topics" / "1.txt").mkdir(parents=True)
    with pytest.raises(CatalogError, match="a folder"):
        plan(tables, bags, DEPTH)


@pytest.mark.parametrize(
    "there", [f"{DEPTH}.bag", f"{DEPTH}.bag.active", "deeper/GreenTowel_Corner_01_pi16.0.5_R1.bag"]
)
def test_what_is_recorded_is_never_planned_over(tables: Path, bags: Path, there: str) -> None:
    (bags / there).parent.mkdir(exist_ok=True)
    (bags / there).touch()
    found = plan(tables, bags, DEPTH)
    assert found.in_the_way == (bags / there,)
    assert found.record()["commands"] is None


def test_folders_and_links_to_nothing_are_not_planned_over_either(tables: Path, bags: Path) -> None:
    (bags / DEPTH).mkdir()
    assert plan(tables, bags, DEPTH).in_the_way == (bags / DEPTH,)
    (bags / f"{COLOR}.bag").symlink_to(bags / "elsewhere")
    with pytest.warns(match="a link to nothing"):
        assert plan(tables, bags, COLOR).in_the_way == (bags / f"{COLOR}.bag",)


def test_a_recording_across_the_view_asks_for_its_empty_scene(tables: Path, bags: Path) -> None:
    assert "record-plan camera_default_0" in plan(tables, bags, COLOR).before[-1]
    (bags / "camera_default_0.bag").touch()
    assert "is there" in plan(tables, bags, COLOR).before[-1]
    assert "empty scene" not in " ".join(plan(tables, bags, DEPTH).before)
    (tables / "backgrounds.csv").write_text(f"topics_file,source,from_s,to_s\n1,{COLOR},0,2\n")
    assert "its own background" in plan(tables, bags, COLOR).before[-1]


def test_an_empty_scene_is_planned_without_a_garment(tables: Path, bags: Path) -> None:
    found = plan(tables, bags, "camera_default_0")
    assert found.path == bags / "camera_default_0.bag"
    assert "holds no garment" in found.before[-1]
    assert found.afterwards[-1] == "garment build axis=B topics_file=1"
    list_recording(tables, "MyScarf_Corner_pi16_0.5_B7")
    assert plan(tables, bags, "camera_default_6").topics_path.name == "1.txt"


def test_the_other_half_of_a_measurement_is_named_until_it_is_there(tables: Path, bags: Path) -> None:
    assert plan(tables, bags, COLOR).afterwards[-1] == f"garment record-plan {DEPTH}"
    (bags / f"{DEPTH}.bag").touch()
    assert plan(tables, bags, COLOR).afterwards[-1] == f"garment build {COLOR}"


@pytest.mark.parametrize(
    ("text", "nearest"),
    [
        ("GreenTowel_Rular_01_pi16_0.5_R1", "GreenTowel_Ruler_01_pi16_0.5_R1 or "),
        ("greentowel corner 01 pi16 0,5 r1", "GreenTowel_Corner_01_pi16_0.5_R1?"),
        ("FelShirt_Ruler", "FelShirt_Ruler_pi16_0.5_R1?"),
        ("camera_default_4", "expected camera_default_0"),
        ("Bathrobe_Free_pi8_1.5_R9", "recordings.csv"),
    ],
)
def test_a_name_that_is_not_known_gets_the_nearest_ones(tables: Path, bags: Path, text: str, nearest: str) -> None:
    with pytest.raises(CatalogError) as refused:
        plan(tables, bags, text)
    assert nearest in str(refused.value)


@given(text=st.text(max_size=40))
def test_any_text_is_planned_or_refused_in_one_line(text: str) -> None:
    catalog = Catalog.load(packaged_workspace() / "catalog").with_folder(Path("nowhere"))
    message = "planned"
    try:
        plan_recording(catalog, text)
    except CatalogError as error:
        message = str(error)
    assert len(message.splitlines()) == 1


@settings(max_examples=50, deadline=None)
@given(content=st.binary(max_size=60) | st.text("/ab_#\n ", max_size=40).map(str.encode))
def test_any_topics_file_is_used_or_refused_in_one_line(
    content: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("any")
    shutil.copytree(packaged_workspace() / "catalog", folder, dirs_exist_ok=True)
    (folder / "topics" / "1.txt").write_bytes(content)
    topics, message = ["/tf"], "planned"
    try:
        topics = list(plan_recording(Catalog.load(folder).with_folder(folder / "nowhere"), DEPTH).topics)
    except CatalogError as error:
        message = str(error)
    assert len(message.splitlines()) == 1
    assert len(set(topics)) == len(topics) > 0
    assert all(topic.startswith("/") and topic.isprintable() for topic in topics)


def test_a_folder_that_no_terminal_shows_is_refused(tables: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no terminal shows"):
        plan(tables, tmp_path / "two\nlines", DEPTH)


def test_nearest_names_are_few_and_the_very_name_is_alone() -> None:
    names = [f"Towel_0{number}" for number in range(9)]
    assert nearest_names("TOWEL_03", names) == ["Towel_03"]
    assert len(nearest_names("Towel_0x", names)) == 3
    assert nearest_names("qqq", names) == []

"""Laws of the code fingerprint: which edits change it, which do not, and what it refuses to follow."""

from __future__ import annotations

import ast
import json
import random
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import garment_dataset
from garment_dataset.engine.codebase.fingerprint import (
    CodeBase,
    Fingerprint,
    changed_parts,
    fingerprint,
    library_versions,
)
from garment_dataset.errors import UntraceableCodeError

if TYPE_CHECKING:
    from _pytest.mark.structures import ParameterSet

PACKAGE = Path(garment_dataset.__file__).parent


def write(folder: Path, text: str) -> Path:
    """Write a package from one text: ``--- name.py`` begins a file, what comes before belongs to ``m.py``."""
    package = folder / "pkg"
    shutil.rmtree(package, ignore_errors=True)
    _, *rest = re.split(r"^--- (\S+)(?:\n|\Z)", f"--- m.py\n{text}", flags=re.MULTILINE)
    for name, source in {"__init__.py": "", **dict(zip(rest[::2], rest[1::2], strict=True))}.items():
        path = package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source, "utf-8")
    return package


def of(folder: Path, text: str, **options: tuple[str, ...]) -> Fingerprint:
    """Return the fingerprint of ``f`` in ``m.py`` of a package written from ``text``."""
    return fingerprint("pkg.m:f", roots={"pkg": write(folder, text)}, **options)


def laws(name: str) -> dict[str, str]:
    """Return the pieces of code in a file of laws, by what stands over them."""
    text = (Path(__file__).parent / "fingerprint_laws" / f"{name}.txt").read_text("utf-8")
    _, *pieces = re.split(r"^## (.*)\n", text, flags=re.MULTILINE)
    return {title: code.rstrip("\n") for title, code in zip(pieces[::2], pieces[1::2], strict=True)}


def edits(name: str) -> list[ParameterSet]:
    """Return the edits of a file: code in which ``«old→new»`` stands for what is edited."""
    return [
        pytest.param(re.sub(_EDIT, r"\1", code, flags=re.DOTALL), re.sub(_EDIT, r"\2", code, flags=re.DOTALL), id=title)
        for title, code in laws(name).items()
    ]


_EDIT = "«(.*?)→(.*?)»"


@pytest.mark.parametrize(("before", "after"), edits("changes"))
def test_an_edit_that_matters_changes_the_fingerprint(tmp_path: Path, before: str, after: str) -> None:
    old, new = of(tmp_path, before), of(tmp_path, after)
    assert old.digest != new.digest
    assert changed_parts(old.parts, new.parts)


@pytest.mark.parametrize(("before", "after"), edits("keeps"))
def test_an_edit_that_does_not_matter_keeps_the_fingerprint(tmp_path: Path, before: str, after: str) -> None:
    old, new = of(tmp_path, before), of(tmp_path, after)
    assert (old.digest, old.parts) == (new.digest, new.parts)


REFUSED = [
    *(pytest.param(code, *title.split(" | ")[1:], id=title.split(" | ")[0]) for title, code in laws("refused").items()),
    pytest.param(f"def f(): return {'-' * 400}1", "m.py:1", "nested too deeply", id="too deep for us"),
    pytest.param(f"def f(): return {'-' * 9000}1", "m.py", "cannot be read as Python", id="too deep for Python"),
    pytest.param("def f(): return '\0'", "m.py", "cannot be read as Python", id="a null byte"),
]
"""Code that cannot be followed, where, and what the message names."""


@pytest.mark.parametrize(("text", "where", "names"), REFUSED)
def test_what_cannot_be_followed_is_refused(tmp_path: Path, text: str, where: str, names: str) -> None:
    with pytest.raises(UntraceableCodeError) as caught:
        of(tmp_path, text)
    assert where in str(caught.value.where)
    assert names in str(caught.value)


@pytest.mark.parametrize("text", [pytest.param(code, id=title) for title, code in laws("allowed").items()])
def test_what_can_be_followed_is_not_refused(tmp_path: Path, text: str) -> None:
    assert "pkg.m:f" in of(tmp_path, text).parts


# -- what a fingerprint says

TWO_AWAY = """
from pkg.a import g
X = 1
def f(): return g(X)
--- a.py
from pkg.b import h
def g(a): return h(a)
--- b.py
def h(a): return a
"""


def test_parts_name_what_is_in_reach(tmp_path: Path) -> None:
    found = of(tmp_path, TWO_AWAY + "def unrelated(): pass")
    assert list(found.parts) == ["pkg.a:g", "pkg.b:h", "pkg.m:X", "pkg.m:f"]
    assert all(re.fullmatch("[0-9a-f]{16}", part) for part in found.parts.values())
    assert re.fullmatch("[0-9a-f]{64}", found.digest)


def test_changed_parts_name_the_function(tmp_path: Path) -> None:
    old = of(tmp_path, TWO_AWAY)
    helper = of(tmp_path, TWO_AWAY.replace("def h(a): return a", "def h(a): return -a"))
    moved = of(tmp_path, TWO_AWAY.replace("def h(a): return a", "def i(a): return a\ndef h(a): return i(a)"))
    assert changed_parts(old.parts, old.parts) == []
    assert changed_parts(old.parts, helper.parts) == [("pkg.b:h", "changed")]
    assert changed_parts(old.parts, moved.parts) == [("pkg.b:h", "changed"), ("pkg.b:i", "added")]
    assert changed_parts(moved.parts, old.parts) == [("pkg.b:h", "changed"), ("pkg.b:i", "removed")]


def test_the_place_on_disk_does_not_count(tmp_path: Path) -> None:
    assert of(tmp_path / "here", TWO_AWAY).digest == of(tmp_path / "there", TWO_AWAY).digest


def test_functions_of_equal_code_have_fingerprints_of_their_own(tmp_path: Path) -> None:
    code_base = CodeBase({"pkg": write(tmp_path, "def f(): return 1\ndef g(): return 1")})
    assert code_base.fingerprint("pkg.m:f").digest != code_base.fingerprint("pkg.m:g").digest


def test_what_was_asked_before_does_not_count(tmp_path: Path) -> None:
    roots = {"pkg": write(tmp_path, TWO_AWAY)}
    code_base = CodeBase(roots)
    entries = ["pkg.m:f", "pkg.a:g", "pkg.b:h", "pkg.m:X", "pkg.m:f"]
    assert [code_base.fingerprint(each) for each in entries] == [fingerprint(each, roots=roots) for each in entries]


def test_libraries_are_the_third_party_roots_in_reach(tmp_path: Path) -> None:
    found = of(
        tmp_path,
        """
import json, cv2, numpy.linalg, pandas
from typing import TYPE_CHECKING
if TYPE_CHECKING: import pyarrow as pa
def f(t: "pa.Table"):
    import rosbags.rosbag1 as r
    return json, numpy.linalg.norm, r
def g(): return cv2
""",
    )
    assert found.libraries == ("numpy", "pyarrow", "rosbags")


def test_files_are_all_that_was_consulted(tmp_path: Path) -> None:
    text = (
        "from pkg.s import g\ndef f(): return g()\n--- s/__init__.py\nfrom .a import g\n--- s/a.py\ndef g(): pass"
        "\n--- unrelated.py\n--- n/__init__.py"
    )
    folder = tmp_path / "pkg"
    names = ["", "__init__.py", "m.py", "s", "s/__init__.py", "s/a.py"]
    assert of(tmp_path, text).files == tuple(folder / name for name in names)


def test_a_file_that_comes_between_is_noticed_by_its_folder(tmp_path: Path) -> None:
    text = "from pkg.s import g\ndef f(): return g.h()\n--- s/g.py\ndef h(): return 1"
    before = of(tmp_path, text)
    after = of(tmp_path, text + "\n--- s/g/__init__.py\ndef h(): return 2")
    assert before.digest != after.digest
    assert tmp_path / "pkg" / "s" in before.files


def test_several_packages_are_followed(tmp_path: Path) -> None:
    mine, other = write(tmp_path / "mine", "import pkg2.m\ndef f(): return pkg2.m.f()"), tmp_path / "other" / "m.py"
    write(other.parent, "def f(): return 1")
    roots = {"pkg": mine, "pkg2": other.parent / "pkg"}
    both, one = fingerprint("pkg.m:f", roots=roots), fingerprint("pkg.m:f", roots={"pkg": mine})
    assert (list(both.parts), both.libraries) == (["pkg.m:f", "pkg2.m:f"], ())
    assert (list(one.parts), one.libraries) == (["pkg.m:f"], ("pkg2",))


def test_a_single_file_is_a_root(tmp_path: Path) -> None:
    (tmp_path / "helpers.py").write_text("def g(): return 1")
    package = write(tmp_path, "from helpers import g\ndef f(): return g()")
    found = fingerprint("pkg.m:f", roots={"pkg": package, "helpers": tmp_path / "helpers.py"})
    assert list(found.parts) == ["helpers:g", "pkg.m:f"]


@pytest.mark.parametrize(
    "entry", ["pkg.m", "pkg.m:", "pkg.m:missing", "pkg.missing:f", "numpy:sum", "pkg.m:os", "pkg:m"]
)
def test_an_entry_that_is_no_first_party_name_is_refused(tmp_path: Path, entry: str) -> None:
    package = write(tmp_path, "import os\ndef f(): pass")
    with pytest.raises(UntraceableCodeError):
        fingerprint(entry, roots={"pkg": package})


def test_a_refusal_tells_the_way(tmp_path: Path) -> None:
    with pytest.raises(UntraceableCodeError, match=r"b\.py:1: .*eval.*pkg\.m:f -> pkg\.a:g -> pkg\.b:h$"):
        of(tmp_path, TWO_AWAY.replace("def h(a): return a", "def h(a): return eval(a)"))


# -- fields whose values are in the key

PARAMS = """
from __future__ import annotations
from typing import Annotated, ClassVar
from pydantic import AfterValidator, BaseModel, Field, PrivateAttr, computed_field, field_validator, model_validator
class Way:
    def go(self): return 1
class P(BaseModel):
    a: int = 1
    way: Way = Field(None, description="how")
    hidden: int = Field(2, exclude=True)
    limit: ClassVar[int] = 3
    _own: int = PrivateAttr(4)
    other = 5
    @field_validator("a")
    @classmethod
    def check(cls, value): return value + 6
    @property
    def more(self): return self.a + 7
    @computed_field
    def most(self) -> int: return self.a + 8
    def text(self): return f"{self.a} and 9"
    @model_validator(mode="after")
    def whole(self): return self if self.a < 11 else None
    kept: Annotated[int, AfterValidator(lambda value: value + 12)] = 13
def f(params: P): return params.a
"""


@pytest.mark.parametrize(
    ("old", "new", "counts"),
    [
        ("a: int = 1", "a: int = 10", False),
        ("a: int = 1", "a: float = 1", False),
        ("a: int = 1", "a: int = 1\n    b: int = 2", False),
        ('"how"', '"in which way"', False),
        ("return 1", "return 10", True),
        ("hidden: int = Field(2", "hidden: int = Field(20", True),
        ("ClassVar[int] = 3", "ClassVar[int] = 30", True),
        ("PrivateAttr(4)", "PrivateAttr(40)", True),
        ("other = 5", "other = 50", True),
        ("value + 6", "value + 60", True),
        ("self.a + 7", "self.a + 70", True),
        ("self.a + 8", "self.a + 80", True),
        ("and 9", "and 90", True),
        ("self.a < 11", "self.a < 110", True),
        ("value + 12", "value + 120", False),  # what it makes of a value is in the key
        ("= 13", "= 130", False),
        ("class P(BaseModel)", "class P(BaseModel, frozen=True)", True),
    ],
)
def test_excluded_fields_do_not_count_and_the_rest_of_the_class_does(
    tmp_path: Path, old: str, new: str, *, counts: bool
) -> None:
    excluded = ("pkg.m:P",)
    before = of(tmp_path, PARAMS, fields_excluded=excluded)
    after = of(tmp_path, PARAMS.replace(old, new), fields_excluded=excluded)
    assert (before.digest != after.digest) is counts
    assert of(tmp_path, PARAMS).digest != of(tmp_path, PARAMS.replace(old, new)).digest


def test_a_file_named_by_a_parameter_is_refused_in_a_method_of_the_parameters_too(tmp_path: Path) -> None:
    text = PARAMS + "    def text(self): return open(self.a).read()\n"
    text = text.replace("def f(params: P): return params.a\n", "") + "def f(params: P): return params.text()\n"
    with pytest.raises(UntraceableCodeError, match=r"open\(self\.a\)"):
        of(tmp_path, text, fields_excluded=("pkg.m:P",))


# -- the real package

STAGES = [
    f"garment_dataset.stages.{path.stem}:{path.stem}"
    for path in sorted((PACKAGE / "stages").glob("[a-z]*.py"))
    if "STAGE = " in path.read_text("utf-8")
]


def test_there_are_stages() -> None:
    assert STAGES


@pytest.mark.parametrize("entry", ["garment_dataset.engine.table:TableSpec", *STAGES])
def test_the_package_can_be_followed(entry: str) -> None:
    found = fingerprint(entry, roots={"garment_dataset": PACKAGE})
    assert entry in found.parts
    assert found.parts.keys().isdisjoint({*STAGES} - {entry})
    assert "pyarrow" in found.libraries


def test_rewriting_every_file_without_comments_and_layout_keeps_the_fingerprint(tmp_path: Path) -> None:
    package = tmp_path / "garment_dataset"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    for path in package.rglob("*.py"):
        path.write_text(ast.unparse(ast.parse(path.read_text("utf-8"))), "utf-8")
    old, new = CodeBase({"garment_dataset": PACKAGE}), CodeBase({"garment_dataset": package})
    assert [old.fingerprint(each).parts for each in STAGES] == [new.fingerprint(each).parts for each in STAGES]


def test_any_constant_in_reach_counts(tmp_path: Path) -> None:
    package = tmp_path / "garment_dataset"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    entry = "garment_dataset.engine.table:TableSpec"
    before = fingerprint(entry, roots={"garment_dataset": package})
    path = package / "engine" / "table.py"
    tree = ast.parse(path.read_text("utf-8"))
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    in_reach = [each for each in tree.body if getattr(each, "name", "") in {"TableSpec", "Column", "arrow_type"}]
    constants = [
        node
        for definition in in_reach
        for node in ast.walk(definition)
        if isinstance(node, ast.Constant) and isinstance(node.value, str | int) and id(node) not in docstrings
    ]
    for node in random.Random(5).sample(constants, 20):
        value = node.value
        node.value = f"{value}x" if isinstance(value, str) else repr(value)
        path.write_text(ast.unparse(tree), "utf-8")
        node.value = value
        assert fingerprint(entry, roots={"garment_dataset": package}).digest != before.digest


RUN = """
import json, sys
from pathlib import Path
from garment_dataset.engine.codebase.fingerprint import CodeBase
root = Path(sys.argv[1])
code_base = CodeBase({root.name: root})
found = [code_base.fingerprint(entry) for entry in sys.argv[2:]]
print(json.dumps([[each.digest for each in found], sorted(sys.modules)]))
"""


def run_apart(folder: Path, python: str, root: Path, entries: list[str], seed: int = 1) -> tuple[list[str], list[str]]:
    """Take fingerprints in a Python that has nothing installed; return them and the modules it then has."""
    engine = folder / "garment_dataset" / "engine"
    if not engine.exists():
        engine.mkdir(parents=True)
        shutil.copy(PACKAGE / "errors.py", engine.parent)
        for path in (engine.parent / "__init__.py", engine / "__init__.py"):
            path.write_text("")
        shutil.copy(PACKAGE / "engine" / "canonical.py", engine)
        shutil.copytree(PACKAGE / "engine" / "codebase", engine / "codebase")
    environment = {"PYTHONPATH": str(folder), "PYTHONHASHSEED": str(seed), "PATH": "/usr/bin:/bin"}
    command = [python, "-c", RUN, str(root), *entries]
    result = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    digests, modules = json.loads(result.stdout)
    return digests, modules


def test_nothing_is_imported_and_hash_seeds_do_not_count(tmp_path: Path) -> None:
    one, modules = run_apart(tmp_path, sys.executable, PACKAGE, STAGES)
    assert run_apart(tmp_path, sys.executable, PACKAGE, STAGES, seed=2)[0] == one
    assert one == [fingerprint(each, roots={"garment_dataset": PACKAGE}).digest for each in STAGES]
    assert "garment_dataset.tables" not in modules
    third_party = {"cv2", "numpy", "pandas", "pyarrow", "pydantic", "rich", "rosbags"}
    assert third_party.isdisjoint(name.partition(".")[0] for name in modules)


@pytest.mark.parametrize("version", ["3.11", "3.12", "3.13", "3.14"])
def test_every_python_finds_the_same(tmp_path: Path, version: str) -> None:
    python = find_python(version)
    if python is None:
        pytest.skip(f"no Python {version} here")
    assert run_apart(tmp_path, python, PACKAGE, STAGES)[0] == run_apart(tmp_path, sys.executable, PACKAGE, STAGES)[0]


NEW_SYNTAX = """
class C:
    def g(self): return 1
class D[T: C](list[T]):
    def h[U](self, a: U, b: T) -> T: return b
type X[K] = dict[K, C] | D[K]
def f[T: (C, int), *Ts, **P](a: X[int], b: T, *args: *Ts) -> T: return f"{a["k"]!r:>{b}}"
"""


def test_type_parameters_are_names_of_their_own(tmp_path: Path) -> None:
    pythons = [python for version in ("3.12", "3.13", "3.14") if (python := find_python(version)) is not None]
    if not pythons:
        pytest.skip("no Python that knows type parameters here")
    digests = set()
    for number, source in enumerate([NEW_SYNTAX, NEW_SYNTAX, NEW_SYNTAX.replace("return 1", "return 2")]):
        root = write(tmp_path / str(number), source)
        digests |= {(number < 2, *run_apart(tmp_path, python, root, ["pkg.m:f"])[0]) for python in pythons}
    assert len(digests) == 2


def find_python(version: str) -> str | None:
    candidates = [
        shutil.which(f"python{version}"),
        *map(str, Path.home().glob(f".pyenv/versions/{version}.*/bin/python")),
    ]
    for python in filter(None, candidates):
        if subprocess.run([python, "-c", ""], capture_output=True, check=False).returncode == 0:
            return python
    return None


# -- versions of libraries


def test_versions_are_those_of_the_distributions() -> None:
    assert library_versions(["numpy", "cv2", "_pytest"]) == {
        "_pytest": metadata.version("pytest"),
        "cv2": metadata.version("opencv-python-headless"),
        "numpy": metadata.version("numpy"),
    }


def test_an_absent_library_is_said_to_be_absent() -> None:
    assert library_versions(["no_such_library"]) == {"no_such_library": "not installed"}


def test_code_of_no_distribution_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "homemade.py").write_text("raise RuntimeError")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UntraceableCodeError, match=r"^homemade: belongs to no installed distribution"):
        library_versions(["homemade"])


def test_asking_for_versions_imports_nothing() -> None:
    code = (
        "import sys; from garment_dataset.engine.codebase.libraries import library_versions;"
        "library_versions(['numpy', 'cv2', 'pandas', '_pytest']); print(*sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=PACKAGE.parent)
    assert not {"numpy", "cv2", "pandas", "_pytest"} & set(found.stdout.split())

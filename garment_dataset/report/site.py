"""The folder of a report, written in this one place: only what changed is made, only what it made is removed."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.canonical import digest
from garment_dataset.errors import MissingExtraError, UsageError
from garment_dataset.report.code import report_code

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from garment_dataset.report.facts import RecordingFacts, SiteFacts

INDEX, RECORDINGS, ASSETS, MANIFEST = "index.html", "recordings", "assets", "report.json"
CAP_BYTES = 4_000_000
"""No page is larger."""

_FORMAT = 1
_OWN = Path(__file__).parent / "static"


@dataclass
class Written:
    """What came of writing a report.

    Parameters
    ----------
    index : Path
        The first page.
    made, kept, removed : list of str
        Files that were written, were as they should be, and were gone from the catalog.
    faults : list of str
        Pages that say no more than why there is no more to say.
    """

    index: Path
    made: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


def require_extra() -> None:
    """Refuse to begin without the libraries of the extra.

    Raises
    ------
    MissingExtraError
        If one is not installed.
    """
    for module, name in (("jinja2", "jinja2"), ("plotly", "plotly"), ("matplotlib", "matplotlib")):
        if find_spec(module) is None:
            hint = "Install it with: pip install 'garment-dataset[report]'"
            raise MissingExtraError(f"a report needs {name}", hint=hint)


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return what a folder's earlier report says of itself; nothing where there is none, or it cannot be read."""
    try:
        found: dict[str, Any] = json.loads((folder / MANIFEST).read_text("utf-8"))
        return found if found.get("format") == _FORMAT and isinstance(found.get("files"), dict) else {}
    except (OSError, ValueError, AttributeError):
        return {}


class Site:
    """A folder that a report is written to.

    Parameters
    ----------
    folder : Path
        Made where it is not there.

    Raises
    ------
    UsageError
        If it is there and holds something else than a report.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        if folder.exists() and not folder.is_dir():
            raise UsageError("no folder for a report", where=folder, found="a file")
        self._before: dict[str, dict[str, str]] = read_manifest(folder).get("files", {})
        if not self._before and (folder / INDEX).exists():
            hint = "Name another folder with --out, or remove that page."
            raise UsageError("a page that no report made is in the way", where=folder / INDEX, hint=hint)
        self._files: dict[str, dict[str, str]] = {}
        self._broken: set[str] = set()
        self.written = Written(folder / INDEX)

    def put(self, name: str, key: str, make: Callable[[], bytes]) -> None:
        """Write a file, unless the one that is there was made of the same.

        Parameters
        ----------
        name : str
            Under the folder.
        key : str
            Digest of all that the file is made of.
        make : callable
            Returns its content.
        """
        path = self.folder / name
        before = self._before.get(name)
        if before is not None and before["key"] == key and _content(path) == before["content"]:
            self._files[name] = before
            self.written.kept.append(name)
            return
        data = make()
        key = "" if name in self._broken else key
        path.parent.mkdir(parents=True, exist_ok=True)
        if before is None and path.exists() and path.read_bytes() != data:
            hint = "Name another folder with --out, or remove that file."
            raise UsageError("a file that no report made is in the way", where=path, hint=hint)
        self._files[name] = {"key": key, "content": hashlib.sha256(data).hexdigest()}
        self._save({**self._before, **self._files}, {})  # before the file: whoever is interrupted knows it again
        temporary = path.with_name(f".{path.name}.new")
        temporary.write_bytes(data)
        temporary.replace(path)
        self.written.made.append(name)

    def broken(self, name: str, fault: str) -> None:
        """Note that a page which is being made says no more than why: the next report tries again."""
        self._broken.add(name)
        self.written.faults.append(fault)

    def finish(self, remembered: Mapping[str, Any]) -> Written:
        """Remove the pages of what is gone, and write down what was made.

        Parameters
        ----------
        remembered : mapping
            JSON-like: what the next report may use again.
        """
        for name, known in self._before.items():
            path = self.folder / name
            if name not in self._files and _is_inside(name) and _content(path) == known["content"]:
                path.unlink()
                self.written.removed.append(name)
        self._save(self._files, remembered)
        return self.written

    def _save(self, files: Mapping[str, dict[str, str]], remembered: Mapping[str, Any]) -> None:
        manifest = {"format": _FORMAT, "files": dict(sorted(files.items())), **remembered}
        text = json.dumps(manifest, indent=1, sort_keys=True, ensure_ascii=True) + "\n"
        path = self.folder / MANIFEST
        if _content(path) != hashlib.sha256(text.encode()).hexdigest():
            temporary = path.with_name(f".{MANIFEST}.new")
            temporary.write_text(text, "utf-8")
            temporary.replace(path)


def _is_inside(name: str) -> bool:
    """Say whether a name of an earlier report stays within its folder, as all that it wrote do."""
    parts = PurePosixPath(name).parts
    return bool(parts) and parts[0] in {INDEX, RECORDINGS, ASSETS} and ".." not in parts


def _content(path: Path) -> str | None:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None


def put_assets(site: Site) -> None:
    """Write what all pages share: the curves' library, the report's own script and its styles."""
    spec = find_spec("plotly")
    assert spec is not None
    assert spec.origin is not None
    library = Path(spec.origin).parent / "package_data" / "plotly.min.js"
    for path in (library, *sorted(_OWN.iterdir())):
        data = path.read_bytes()
        site.put(f"{ASSETS}/{path.name}", hashlib.sha256(data).hexdigest(), lambda data=data: data)  # type: ignore[misc]


def recording_key(facts: RecordingFacts) -> str:
    """Return the digest of all that the page of a recording is made of."""
    shown = {name: value for name, value in asdict(facts).items() if name != "path"}
    return digest("report-recording/1", [report_code(), _plain(shown)])


def index_key(facts: SiteFacts, faults: Sequence[str]) -> str:
    """Return the digest of all that the first page is made of, pages among it that are not whole."""
    shown = {name: value for name, value in asdict(facts).items() if name not in {"folder", "root"}}
    for each in shown["recordings"]:
        each.pop("path")
    return digest("report-index/1", [report_code(), _plain(shown), list(faults)])


def _plain(value: object) -> Any:  # noqa: ANN401 - JSON-like
    return json.loads(json.dumps(value, default=str))

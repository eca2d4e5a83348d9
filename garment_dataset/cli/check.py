"""``garment check``: recordings held against a contract."""

from __future__ import annotations

import dataclasses
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.output import JsonOption, WorkspaceOption, print_json, say
from garment_dataset.errors import CatalogError, RecordingNameError, UsageError, printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from garment_dataset.checks.contract import Contract
    from garment_dataset.checks.finding import CheckFinding
    from garment_dataset.layout import Layout

_STORAGE = (".bag", ".active", ".db3", ".mcap")


class _Subject(NamedTuple):
    """A bag to be checked."""

    name: str
    path: Path
    axis: str | None = None
    background: str | None = None
    """What to provide for the empty scene, if it is missing."""
    shows_empty_scene: bool = False


def check(
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="FILTERS|BAGS",
            help="Which recordings, or bags by their paths.",
            show_default=False,
            autocompletion=completion.filters,
        ),
    ] = None,
    contract: Annotated[
        Path | None,
        typer.Option("--contract", help="[default: contract.toml in the catalog]", show_default=False),
    ] = None,
    save: Annotated[
        Path | None, typer.Option("--save", help="Write the findings as Parquet, table `checks`.", show_default=False)
    ] = None,
    learns: Annotated[
        bool, typer.Option("--init", help="Learn a contract from these recordings, which are good.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="With --init: its file. [default: the workspace's contract]", show_default=False),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="With --init: replace the file.")] = False,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Hold recordings against the contract; exit with 1 when one breaks it."""
    from garment_dataset.checks.contract import CONTRACT, contract_of, read_contract
    from garment_dataset.layout import Layout, packaged_workspace, workspace_above

    _refuse_mixtures({"--out": out is not None, "--overwrite": overwrite}, learns=learns)
    place = Layout.find(workspace) if workspace or workspace_above(Path.cwd()) else None
    own = None if place is None else place.catalog_dir / CONTRACT
    folder = packaged_workspace() / "catalog" if place is None else place.catalog_dir
    rules = contract_of(folder) if contract is None else read_contract(contract)
    subjects = _subjects(what or [], place)
    if learns:
        _learn(subjects, rules, out or own, overwrite=overwrite)
        return
    found = {subject.name: findings for subject, findings in _run(subjects, rules, quiet=as_json)}
    broken = [name for name, findings in found.items() if any(each.severity != "note" for each in findings)]
    if save is not None:
        from garment_dataset.checks.table import save_findings

        save_findings(save, found)
    if as_json:
        print_json([_record(subject, found[subject.name]) for subject in subjects])
    else:
        _sum_up(found, broken)
    if broken:
        raise typer.Exit(1)


def _refuse_mixtures(only_learning: Mapping[str, bool], *, learns: bool) -> None:
    given = [option for option, is_given in only_learning.items() if is_given]
    if given and not learns:
        raise UsageError(f"{given[0]} says where a learnt contract goes", hint="Add --init.")


def _subjects(terms: Sequence[str], place: Layout | None) -> list[_Subject]:
    """Return the bags that are meant: files by their paths, or recordings of the workspace by filters."""
    files = [Path(term) for term in terms if _is_file(term)]
    if files and len(files) < len(terms):
        other = next(term for term in terms if not _is_file(term))
        raise UsageError("bags and filters do not go together", found=f"{files[0]} and {other!r}")
    if absent := next((path for path in files if not path.exists()), None):
        raise UsageError("no such bag", where=absent, hint="Without a path, filters choose among the workspace's bags.")
    if files:
        stems = Counter(path.stem for path in files)
        return [_subject_of(path, path.stem if stems[path.stem] == 1 else str(path), place) for path in files]
    if place is None:
        hint = "Name bags, or go to a workspace (`garment init DIR` makes one)."
        raise UsageError("nothing to check", found="no workspace here, and no bag named", hint=hint)
    return _recorded(terms, place)


def _is_file(term: str) -> bool:
    if "*" in term or "=" in term:
        return Path(term).exists()
    return term.lower().endswith(_STORAGE) or (Path(term) / "metadata.yaml").is_file()


def _subject_of(path: Path, name: str, place: Layout | None) -> _Subject:
    from garment_dataset.catalog.names import BackgroundName
    from garment_dataset.catalog.schemes import THESIS, scheme_of

    scheme = THESIS if place is None else scheme_of(place)
    try:
        parsed = scheme.parse(path.name)
    except RecordingNameError:
        return _Subject(name, path)
    if isinstance(parsed, BackgroundName):
        return _Subject(name, path, shows_empty_scene=True)
    return _Subject(name, path, parsed.axis)


def _recorded(terms: Sequence[str], place: Layout) -> list[_Subject]:
    """Return the recordings of the workspace that are there and wanted; without filters, empty scenes as well."""
    from garment_dataset.catalog import Catalog
    from garment_dataset.catalog.names import BackgroundName

    catalog = Catalog.of(place)
    subjects: list[_Subject] = []
    rows = catalog.select(terms)
    for row in rows:
        if row.path is not None:
            background = catalog.background(row.topics_file)
            needed = background.missing if background.path is None else None
            subjects.append(_Subject(row.recording, row.path, row.axis, needed))
    bags = () if terms or catalog.found is None else catalog.found.bags
    scenes = [bag for bag in bags if isinstance(bag.name, BackgroundName)]
    subjects += [_Subject(str(bag.name), bag.path, shows_empty_scene=True) for bag in scenes]
    if not subjects:
        found = f"{len(rows)} recordings, none of which is in {place.recordings_dir}"
        why = catalog.why_nothing(terms) if terms and not rows else None
        raise UsageError("no bag to check", found=found, hint=why or "`garment list` shows what is there.")
    if missing := len(rows) + len(scenes) - len(subjects):
        say(f"{missing} recordings are not there, and not checked: `garment list state=missing` names them")
    return subjects


def _run(
    subjects: Sequence[_Subject], rules: Contract, *, quiet: bool
) -> Iterator[tuple[_Subject, Sequence[CheckFinding]]]:
    """Check one bag after the other, and print what is found as it is found."""
    from garment_dataset.checks.runner import check_bag

    for subject in subjects:
        own = rules.of_empty_scene() if subject.shows_empty_scene else rules
        findings = check_bag(
            subject.path, own, recording=subject.name, axis=subject.axis, background=subject.background
        )
        if findings and not quiet:
            print(printable(subject.name))
            for finding in findings:
                print(printable(f"    {_line(finding)}"), flush=True)
        yield subject, findings


def _line(finding: CheckFinding) -> str:
    at = "" if finding.time_s is None else f" at {finding.time_s:.2f} s"
    where = f" {finding.topic}{at}" if finding.topic is not None else at
    return f"{finding.severity} {finding.code}{where}: {finding.message}" + (
        f". {finding.hint}" if finding.hint else ""
    )


def _sum_up(found: Mapping[str, Sequence[CheckFinding]], broken: Sequence[str]) -> None:
    codes = Counter(each.code for findings in found.values() for each in findings if each.severity != "note")
    passed = f"{len(found) - len(broken)} of {len(found)} bags keep the contract"
    print(", ".join([passed, *(f"{count} {code}" for code, count in codes.items())]))


def _record(subject: _Subject, findings: Sequence[CheckFinding]) -> dict[str, object]:
    passes = all(each.severity == "note" for each in findings)
    found = [dataclasses.asdict(each) for each in findings]
    return {"recording": subject.name, "path": str(subject.path), "passes": passes, "findings": found}


def _learn(subjects: Sequence[_Subject], usual: Contract, out: Path | None, *, overwrite: bool) -> None:
    """Write what good recordings have in common; refuse those that no contract lets pass."""
    from garment_dataset.bags import open_bag
    from garment_dataset.checks.learn import learn, streams_of
    from garment_dataset.checks.reading import read_facts
    from garment_dataset.checks.runner import judge
    from garment_dataset.checks.writing import to_toml

    if out is None:
        raise UsageError("no workspace that the contract could be of", hint="Name its file with --out.")
    if out.exists() and not overwrite:
        raise UsageError("already there", where=out, hint="Add --overwrite to replace it, or name another with --out.")
    with open_bag(subjects[0].path) as bag:
        base = streams_of(bag, usual)
    good = []
    for subject in subjects:
        with open_bag(subject.path) as bag:
            good.append(read_facts(bag, base, axis=subject.axis))
    learnt = learn(good, base)
    for subject, facts in zip(subjects, good, strict=True):
        if faults := [each for each in judge(subject.name, facts, learnt) if each.severity != "note"]:
            hint = "Leave it out: a contract is learnt from recordings that are good."
            raise UsageError("not a good recording", where=subject.path, found=_line(faults[0]), hint=hint)
    title = f"Learnt by `garment check --init` from {len(subjects)} recordings: {subjects[0].name} ..."
    try:
        out.write_text(to_toml(learnt, title), "utf-8")
    except OSError as error:
        raise CatalogError("cannot be written", where=out, found=error.strerror or error) from error
    say(f"wrote {out}: {len(learnt.topics)} topics of {len(subjects)} recordings. Read it; its bounds are theirs.")

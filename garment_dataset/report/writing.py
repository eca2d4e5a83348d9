"""From facts to a written site: each page on its own, so that one which cannot be made stops no other."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from garment_dataset.errors import GarmentError, printable
from garment_dataset.report.curves import READING_ERRORS, curves_of, said, spark_values, summary
from garment_dataset.report.frames import LOOP_FRAMES, Pictures, Tables, pictures_of
from garment_dataset.report.pages import failed_page, index_page, recording_page
from garment_dataset.report.repeats import repeats_of
from garment_dataset.report.site import CAP_BYTES, INDEX, RECORDINGS, index_key, put_assets, recording_key

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from garment_dataset.report.facts import RecordingFacts, SiteFacts
    from garment_dataset.report.site import Site, Written

_FEWEST_FRAMES = 4
_MOTION = (
    ("onset_reason", "why there is no onset", ""),
    ("rest_frames", "frames at rest", ""),
    ("moving_frames", "frames in motion", ""),
    ("rest_noise_m", "scatter at rest", "m"),
    ("moving_noise_m", "scatter in motion", "m"),
    ("garment_length_m", "length of the garment", "m"),
    ("garment_length_std_m", "its standard uncertainty", "m"),
    ("segment_length_m", "length of a segment", "m"),
    ("rest_reason", "why there is no length", ""),
    ("gravity_source", "where the direction of gravity comes from", ""),
)


def write_report(
    facts: SiteFacts, site: Site, remembered: Mapping[str, Any], tell: Callable[[str], None] = lambda _: None
) -> Written:
    """Write a report.

    Parameters
    ----------
    facts : SiteFacts
        What it shows.
    site : Site
        Where to.
    remembered : mapping
        What the next report may use again.
    tell : callable
        Called with the name of each recording that is about to be drawn.
    """
    put_assets(site)
    for each in facts.recordings:
        name = f"{RECORDINGS}/{each.page}"

        def make(each: RecordingFacts = each) -> bytes:
            if each.tables:
                tell(each.recording)
            return _recording(each, facts, site)

        site.put(name, recording_key(each), make)
    site.put(INDEX, index_key(facts, site.written.faults), lambda: _index(facts, site))
    return site.finish(remembered)


def _recording(each: RecordingFacts, facts: SiteFacts, site: Site) -> bytes:
    try:
        return _whole_recording(each, facts)
    except Exception as error:  # noqa: BLE001 - whatever is wrong with one recording, the others have their pages
        why = error.what if isinstance(error, GarmentError) else f"{type(error).__name__}: {error}"
        plain = printable(why.replace(f"{facts.root}/", ""))
        site.broken(f"{RECORDINGS}/{each.page}", f"{each.recording}: {plain}")
        return failed_page(each, plain).encode()


def _whole_recording(each: RecordingFacts, facts: SiteFacts) -> bytes:
    tables = Tables(each.recording, facts.folder)
    curves, faults = curves_of(each.recording, facts.folder, each.tables)
    onset_ns = _onset_ns(tables) if each.tables else None
    results = {"quality": _quality(tables) if each.tables else [], "motion": _motion(tables) if each.tables else {}}
    wanted = LOOP_FRAMES
    while True:
        pictures = _pictures(each, tables, onset_ns, wanted)
        text = recording_page(each, curves, summary(curves) if curves else (), pictures, results, faults)
        if len(data := text.encode()) <= CAP_BYTES:
            return data
        if wanted < _FEWEST_FRAMES:
            said = f"without pictures: the page would be larger than {CAP_BYTES / 1e6:g} MB"
            return recording_page(each, curves, (), Pictures(faults=[said]), results, faults).encode()
        wanted //= 2


def _pictures(each: RecordingFacts, tables: Tables, onset_ns: int | None, wanted: int) -> Pictures:
    if each.path is None:
        return Pictures(faults=["there is no bag here to draw pictures from"])
    if "decode" not in each.tables:
        return Pictures(
            faults=["the bag was not decoded: `garment build` does it, and `garment why NAME` says why not"]
        )
    if not each.is_bag_as_built:
        return Pictures(
            faults=["the bag is not the one that the results were made from: `garment build` makes them anew"]
        )
    return pictures_of(tables, each.path, onset_ns, wanted)


def _onset_ns(tables: Tables) -> int | None:
    motion = tables["motion"]
    known = motion["onset_stamp_ns"].dropna().tolist() if "onset_stamp_ns" in motion else []
    return int(known[0]) if known else None


def _motion(tables: Tables) -> dict[str, str]:
    motion = tables["motion"]
    found = {}
    for column, label, unit in _MOTION:
        if column in motion and len(values := motion[column].dropna()):
            value = values.iloc[0]
            text = value if isinstance(value, str) else f"{float(value):.4g}"
            found[label] = f"{text} {unit}".strip()
    if "onset_std_ns" in motion and len(values := motion["onset_std_ns"].dropna()):
        found["uncertainty of the onset"] = f"{1e-6 * float(values.tolist()[0]):.3g} ms"
    return found


def _quality(tables: Tables) -> list[dict[str, Any]]:
    rows = tables["quality"]
    columns = ("stage", "stream", "verdict", "why", "seen", "used", "coverage", "bridged", "faults", "noise_m", "notes")
    return [{name: _value(row.get(name)) for name in columns} for row in rows.to_dict("records")]


def _value(value: Any) -> Any:  # noqa: ANN401 - whatever a column holds
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list):
        return [printable(str(each)) for each in value]
    return None if value is None or value != value else value  # noqa: PLR0124 - NaN


def _index(facts: SiteFacts, site: Site) -> bytes:
    faults = list(site.written.faults)
    built = [each.recording for each in facts.recordings if each.tables]
    groups = [node.subject for node in facts.others if node.stage == "repeatability" and node.key is not None]
    try:
        sparks, repeats = spark_values(built, facts.folder), repeats_of(facts.folder, groups)
    except READING_ERRORS as error:
        sparks, repeats = {}, []
        faults.append(f"the table of repeats: {said(error)}")
    data = index_page(facts, sparks, repeats, faults).encode()
    if len(data) > CAP_BYTES:
        few = replace(facts, findings=[each for each in facts.findings if each.severity != "note"])
        data = index_page(
            few, {}, repeats, [*faults, "without sparklines and notes: the page would be too large"]
        ).encode()
    return data

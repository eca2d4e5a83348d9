"""Silhouettes and central curves against the truth of simulated recordings; writes docs/accuracy-colour.md.

Each nuisance is drawn alone and all together, on seeds that the pipeline was chosen on and on others; every case is
built with the defaults and as in the thesis.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from garment_dataset import load_features
from garment_dataset.score.recordings import score
from garment_dataset.score.silhouettes import silhouette_errors
from garment_dataset.simulate.orders import Order, run_orders
from garment_dataset.workspace import Workspace

if TYPE_CHECKING:
    from garment_dataset.score.silhouettes import SilhouetteScore

    Scores = dict[str, SilhouetteScore]

ROOT = Path(__file__).parent.parent
SUFFIX = "_pi16_0.5_B1"
FRAMES = 60
"""Rest and half of the way: the sheet hangs, is drawn along and swings."""


class Case(NamedTuple):
    """Recordings of one draw: they share camera and room."""

    nuisance: str
    seed: int
    names: tuple[str, ...]

    @property
    def folder(self) -> str:
        """Return where they lie."""
        return f"{self.nuisance}_{self.seed}"


ALONE = (
    "none",
    "lamps",
    "auto_exposure",
    "flicker",
    "wall",
    "blur_px",
    "color_noise",
    "yaw_rad",
    "wall_hue",
    "pattern",
)
ONE = ("GreenTowel_Corner_01",)
SHEETS = ("GreenTowel_Ruler_01",)
CHOSEN = (
    *(Case(name, 104, SHEETS if name == "yaw_rad" else ONE) for name in ALONE),
    Case("wide", 101, ("FelShirt_Ruler", "WhitePullover_Collar")),
    Case("wide", 103, (*SHEETS, "BlueShirt_Collar")),
    Case("wide", 104, (*SHEETS, "GreenTowel_Corner_01")),
    Case("wide", 105, (*SHEETS, "WhiteBlackShirt_Free")),
)
HELD_OUT = (
    *(Case(name, 207, SHEETS if name == "yaw_rad" else ONE) for name in ALONE),
    Case("wide", 201, (*SHEETS, "GreenTowel_Corner_01")),
    Case("wide", 203, (*SHEETS, "RedSkirt_Belt")),
    Case("wide", 204, (*SHEETS, "WhitePullover_Collar")),
    Case("wide", 207, (*SHEETS, "BlueShirt_Collar")),
    Case("wide", 209, (*SHEETS, "FelShirt_Free")),
)
VARIANTS = {
    "defaults": "",
    "as in the thesis": 'edge = "threshold"\ndrift = false\nshadows = false\nnear_m = 0.0\nalpha = 3.0\nopen_px = 15\n'
    'close_px = 15\nclip = "auto"',
}
PAGE = """# Accuracy of silhouettes and central curves

Made by `python benchmarks/accuracy_color.py [--cache FOLDER]`: it simulates B recordings (scale `small`, the first
{frames} colour images), builds the colour pipeline and scores it (`garment score` does so for any features and truth).
docs/simulation.md says what each nuisance draws. *IoU* is with the true mask below the gripper's point, mean over the
recordings and worst frame of all; *axis* the mean error of the major axis' angle; *midline* the distance of the central
curve from that of the true mask. A frame without a silhouette counts for none of these, but lowers the coverage.

To reach: IoU 0.97, of sheets seen edge-on 0.93; axis 0.3 degrees; midline 1 px.

## Error against nuisance

One nuisance alone, drawn from a seed, then all together (`wide`). *Chosen on*: seeds 100 to 111, which the pipeline's
constants were chosen on; *held out*: seeds from 201, which nothing was chosen on.

| nuisance | | recordings | coverage % | IoU | worst | axis, deg | midline, px | thesis: coverage % | IoU | axis, deg |
|---|---|---|---|---|---|---|---|---|---|---|
{nuisances}

## All nuisances together, by recording

| recording | seed | | coverage % | IoU | worst frame | axis, deg | midline, px |
|---|---|---|---|---|---|---|---|
{recordings}

*As in the thesis*: eq. (5.3) with alpha 3, squares of 15 px, a threshold for an edge, no allowance for a change of
brightness or for shadows, before the largest monochrome part of the background. A wall with folds has no such part.

The towel and the shirt on the ruler are the sheets that are seen open, at an angle or edge-on: 101 (shirt), 104, 204
and 207 are edge-on, 1 to 6 px wide as they swing through the line of sight. The worst frames are the narrowest: of a
sheet of 1 to 2 px, a third of a pixel is a fifth. Towel 207, of the wall's hue with a blur of 1.4 px, is found too
broad by such a part, and misses 0.93; its confidence does not say so. On towel 201 the ruler is told from the cloth in
some frames only.

## Confidence

Whether the column `confidence` falls where silhouettes are worse: rank correlation (Spearman) of `confidence` and IoU
over the frames of all the recordings above, and the mean IoU of frames of low, middle and high confidence.

| | frames | rank correlation | IoU where confidence < 0.90 | 0.90 to 0.95 | 0.95 and more |
|---|---|---|---|---|---|
{confidence}
"""


def main() -> None:
    """Simulate what is not in the cache, build both variants, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cache", type=Path, default=ROOT / "demo" / "accuracy-colour")
    cache: Path = parser.parse_args().cache
    simulate(cache)
    scores = {case: {name: build(cache, case, name) for name in VARIANTS} for case in (*CHOSEN, *HELD_OUT)}
    confidence = [
        confidence_row(use, pd.concat([trust(cache, case) for case in cases]))
        for use, cases in (("chosen on", CHOSEN), ("held out", HELD_OUT))
    ]
    nuisances = [
        nuisance_row(nuisance, use, [scores[case] for case in cases if case.nuisance == nuisance])
        for nuisance in (*ALONE, "wide")
        for use, cases in (("chosen on", CHOSEN), ("held out", HELD_OUT))
    ]
    recordings = [
        recording_row(row, case, "chosen on" if case in CHOSEN else "held out")
        for case, found in scores.items()
        if case.nuisance == "wide"
        for row in found["defaults"].values()
    ]
    tables = {"nuisances": nuisances, "recordings": recordings, "confidence": confidence}
    page = PAGE.format(frames=FRAMES, **{name: "\n".join(rows) for name, rows in tables.items()})
    (ROOT / "docs" / "accuracy-colour.md").write_text(page, "utf-8")


def simulate(cache: Path) -> None:
    """Simulate the recordings that are not there yet, and the empty scenes."""
    orders = [
        Order(name, folder, case.seed, "xtion", "small", "none", frames, case.nuisance)
        for case in (*CHOSEN, *HELD_OUT)
        for folder in (cache / case.folder / "bags",)
        for name, frames in (*((f"{name}{SUFFIX}", FRAMES) for name in case.names), ("camera_default_0", 30))
        if not (folder / f"{name}.bag").is_file()
    ]
    for path in run_orders(orders, 2):
        print(f"simulated {path.parent.parent.name} {path.name}", flush=True)


def build(cache: Path, case: Case, variant: str) -> Scores:
    """Build one variant in a workspace of its own, and return its scores by recording."""
    root = cache / case.folder / variant.replace(" ", "_")
    if not root.is_dir():
        shutil.rmtree(Workspace.create(root).recordings_dir)
        (root / "recordings").symlink_to((cache / case.folder / "bags").resolve())
    pipeline = root / "pipelines" / "colour.toml"
    shutil.copy(ROOT / "pipelines" / "colour.toml", pipeline)
    with pipeline.open("a", encoding="utf-8") as file:
        file.write(f"\n[params.silhouette]\n{VARIANTS[variant]}\n")
    Workspace.find(root).build("axis=B")
    print(f"built {case.folder} {variant}", flush=True)
    wanted = {f"{each}{SUFFIX}" for each in case.names}
    rows = score(root, cache / case.folder / "bags").silhouettes
    return {row.recording: row for row in rows if row.recording in wanted}


def trust(cache: Path, case: Case) -> pd.DataFrame:
    """Return confidence and intersection over union of every frame that was built with the defaults."""
    parts = []
    for name in (f"{each}{SUFFIX}" for each in case.names):
        folder = cache / case.folder / "defaults" / "features"
        found = load_features("silhouettes", folder=folder, recording=name)
        truth = pd.read_parquet(cache / case.folder / "bags" / f"{name}.truth" / "color.parquet")
        shown = truth[truth["area_px"] > 0]
        iou = pd.Series(silhouette_errors(found, None, truth).iou, index=shown["frame"].to_numpy())
        parts.append(pd.DataFrame({"confidence": found.set_index("frame")["confidence"], "iou": iou}).dropna())
    return pd.concat(parts)


def confidence_row(use: str, frames: pd.DataFrame) -> str:
    """Return how confidence and intersection over union go together, as a row of the third table."""
    correlation = frames["confidence"].corr(frames["iou"], method="spearman")
    bins = np.digitize(frames["confidence"], [0.90, 0.95])
    parts = (frames["iou"][bins == number].tolist() for number in range(3))
    means = [f"{mean(part)} ({len(part)})" for part in parts]
    return f"| {' | '.join([use, str(len(frames)), f'{correlation:.2f}', *means])} |"


def nuisance_row(nuisance: str, use: str, found: list[dict[str, Scores]]) -> str:
    """Return one nuisance, on the seeds of one use, as a row of the first table."""
    ours, thesis = ([row for scores in found for row in scores[name].values()] for name in VARIANTS)
    worst = [row.iou_min for row in ours if row.iou_min is not None]
    cells = (
        nuisance if nuisance in {"none", "wide"} else f"`{nuisance}`",
        use,
        len(ours),
        mean([row.coverage for row in ours], "{:.1f}", 100),
        mean([row.iou_mean for row in ours]),
        f"{min(worst):.3f}" if worst else "none",
        mean([row.orientation_mean_rad for row in ours], "{:.2f}", 57.29578),
        mean([row.midline_mean_px for row in ours], "{:.2f}"),
        mean([row.coverage for row in thesis], "{:.1f}", 100),
        mean([row.iou_mean for row in thesis]),
        mean([row.orientation_mean_rad for row in thesis], "{:.2f}", 57.29578),
    )
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def recording_row(row: SilhouetteScore, case: Case, use: str) -> str:
    """Return one recording as a row of the second table."""
    cells = (
        row.recording.removesuffix(SUFFIX),
        str(case.seed),
        use,
        mean([row.coverage], "{:.1f}", 100),
        mean([row.iou_mean]),
        mean([row.iou_min]),
        mean([row.orientation_mean_rad], "{:.2f}", 57.29578),
        mean([row.midline_mean_px], "{:.2f}"),
    )
    return f"| {' | '.join(cells)} |"


def mean(values: list[float | None], form: str = "{:.3f}", times: float = 1) -> str:
    """Return the mean of what is known, or that nothing is."""
    known = [value for value in values if value is not None]
    return form.format(times * sum(known) / len(known)) if known else "none"


if __name__ == "__main__":
    main()

"""Recordings to be simulated: chosen by name or by set, what they take, and their making in parallel."""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from garment_dataset.catalog import Catalog
from garment_dataset.catalog.names import BackgroundName, parse_bag_name
from garment_dataset.errors import GarmentError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

DEMO = (
    "GreenTowel_Ruler_01_pi16_0.5_R1",
    "GreenTowel_Ruler_02_pi16_0.5_R1",
    "GreenTowel_Corner_01_pi16_0.5_R1",
    "GreenTowel_Corner_01_pi16_0.5_B1",
    "camera_default_0",
)
"""Both axes, two holdings, a repeat and the empty scene."""

_DEPTH_BYTES, _COLOR_BYTES = 640 * 480 * 2, 640 * 480 * 3
_FRAMES_PER_S = 29.8
_PAIR_S = 0.11
_PHYSICS_S = {"full": 16.0, "small": 7.0}
_DURATION_S = {"full": 8.0, "small": 3.5}
_BACKGROUND_S = 3.0


@dataclass(frozen=True, slots=True)
class Order:
    """One recording to be simulated, as plain data that crosses to a worker.

    Parameters
    ----------
    name : str
        Of the recording or of the empty scene.
    folder : Path
        Where it goes.
    seed : int
        See :func:`~garment_dataset.simulate.recording.simulate_recording`, as for all that follows.
    noise, scale, compression : str
        Options.
    frames : int, optional
        Most frames per stream.
    nuisance : str
        What is unusual.
    """

    name: str
    folder: Path
    seed: int
    noise: Literal["none", "xtion"]
    scale: Literal["full", "small"]
    compression: Literal["none", "lz4", "bz2"]
    frames: int | None
    nuisance: str = "none"

    def pairs(self) -> int:
        """Return about how many pairs of images it has."""
        background = isinstance(parse_bag_name(self.name), BackgroundName)
        duration_s = _BACKGROUND_S if background else _DURATION_S[self.scale]
        count = int(duration_s * _FRAMES_PER_S)
        return count if self.frames is None else min(count, self.frames)

    def cost(self) -> tuple[int, float]:
        """Return about how many bytes and seconds of one processor it takes, before compression."""
        pairs = self.pairs()
        physics_s = 0.0 if self.name.startswith("camera_default") else _PHYSICS_S[self.scale]
        return pairs * (_DEPTH_BYTES + _COLOR_BYTES) + 2_000_000, physics_s + pairs * _PAIR_S

    def run(self) -> Path:
        """Simulate it."""
        from garment_dataset.simulate.recording import simulate_recording

        return simulate_recording(
            self.name,
            self.folder,
            seed=self.seed,
            noise=self.noise,
            frames=self.frames,
            scale=self.scale,
            compression=self.compression,
            nuisance=self.nuisance,
        )


def names_of(names: Sequence[str], set_name: str | None) -> list[str]:
    """Return the canonical names of what to simulate, each once.

    Parameters
    ----------
    names : sequence of str
        Chosen names.
    set_name : {"thesis", "demo"}, optional
        thesis: every recording of the catalog and the empty scenes that belong to them. demo: :data:`DEMO`.

    Raises
    ------
    GarmentError
        If nothing was chosen.
    RecordingNameError
        If a name is none.
    """
    chosen = list(names)
    if set_name == "demo":
        chosen += DEMO
    if set_name == "thesis":
        rows = Catalog.load().rows
        scenes = {parse_bag_name(row.recording).topics_file - 1 for row in rows}
        chosen += [row.recording for row in rows] + [f"camera_default_{position}" for position in sorted(scenes)]
    if not chosen:
        raise GarmentError("nothing to simulate", expected="names, or --set thesis or --set demo")
    return list(dict.fromkeys(str(parse_bag_name(name)) for name in chosen))


def forecast(orders: Sequence[Order], workers: int) -> str:
    """Return a sentence that says what the orders will take."""
    size, seconds = (sum(parts) for parts in zip(*(order.cost() for order in orders), strict=True))
    minutes = seconds / workers / 60
    compressed = "" if orders[0].compression == "none" else " before compression"
    return (
        f"{len(orders)} recordings into {orders[0].folder}: about {size / 1e9:.1f} GB{compressed}, "
        f"about {max(minutes, 0.1):.1f} minutes with {workers} process{'es' if workers > 1 else ''}"
    )


def run_orders(orders: Sequence[Order], workers: int) -> Iterator[Path]:
    """Simulate all, yielding each bag as it is done."""
    if workers == 1:
        yield from (order.run() for order in orders)
        return
    from multiprocessing import get_context

    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_single_threaded) as pool:
        for future in as_completed([pool.submit(order.run) for order in orders]):
            yield future.result()


def _single_threaded() -> None:
    """Keep the libraries to one thread per process: the processes share the processors among themselves."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # read when numpy is first imported, which is below
    import cv2

    cv2.setNumThreads(1)

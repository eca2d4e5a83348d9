"""``garment simulate``."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Annotated, Literal

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.output import WorkspaceOption, say


def simulate(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAMES",
            help="Recordings or empty scenes (camera_default_0).",
            show_default=False,
            autocompletion=completion.recordings_and_scenes,
        ),
    ] = None,
    set_name: Annotated[
        Literal["thesis", "demo"] | None, typer.Option("--set", help="All names of the thesis, or a few for a demo.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the bags and their truth; by default the workspace's recordings.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Equal seeds give equal bytes.")] = 0,
    noise: Annotated[Literal["none", "xtion"], typer.Option(help="Exact images, or such a sensor's.")] = "xtion",
    scale: Annotated[Literal["full", "small"], typer.Option(help="small: coarser cloth, shorter recordings.")] = "full",
    frames: Annotated[int | None, typer.Option(min=1, help="Most frames per stream.")] = None,
    compression: Annotated[Literal["none", "lz4", "bz2"], typer.Option(help="Of the bags' chunks.")] = "none",
    nuisance: Annotated[
        str, typer.Option(help="What is unusual: none, wide (all of it, drawn from the seed), or names: NAME[,NAME].")
    ] = "none",
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; by default one per processor.")] = None,
    workspace: WorkspaceOption = None,
) -> None:
    """Write simulated recordings, with the truth beside them."""
    from garment_dataset.layout import Layout, refuse_bytes
    from garment_dataset.simulate.nuisance import wanted_names
    from garment_dataset.simulate.orders import Order, forecast, names_of, run_orders
    from garment_dataset.simulate.physics import import_mujoco

    chosen = names_of(names or [], set_name)
    wanted_names(nuisance)
    folder = Layout.find(workspace).recordings_dir if out is None else out
    refuse_bytes("the truth", folder.absolute(), folder)
    orders = [Order(name, folder, seed, noise, scale, compression, frames, nuisance) for name in chosen]
    if any(not order.name.startswith("camera_default") for order in orders):
        import_mujoco()
    workers = min(jobs or os.cpu_count() or 1, len(orders))
    say(forecast(orders, workers))
    began = time.monotonic()
    for done, path in enumerate(run_orders(orders, workers), start=1):
        elapsed_s = time.monotonic() - began
        say(f"[{done}/{len(orders)}] {path} ({path.stat().st_size / 1e6:.0f} MB, {elapsed_s:.0f} s)")

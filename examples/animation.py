"""The moving picture in README.md: depth and colour of two recordings side by side, with what was found in them.

    python examples/animation.py demo docs/images/swing.webp

Recordings of a workspace that ``make demo`` has built, drawn as the loop of their pages in the report.
"""

from __future__ import annotations

import base64
import io
import sys
from pathlib import Path

from PIL import Image

from examples.demo import COLOR, DEPTH
from garment_dataset.report.frames import Tables, pictures_of
from garment_dataset.workspace import Workspace

FRAMES, FRAME_MS, QUALITY = 32, 100, 60


def main() -> None:
    """Write the picture."""
    workspace, out = Workspace.at(sys.argv[1]), Path(sys.argv[2])
    loops = []
    for recording, stream in ((DEPTH, "depth"), (COLOR, "color")):
        tables = Tables(recording, workspace.features_dir)
        made = pictures_of(tables, workspace.recordings_dir / f"{recording}.bag", None, FRAMES)
        loops.append([decoded(each["src"]) for each in made.loop[stream]])
    pictures = [beside(*pair) for pair in zip(*loops, strict=False)]
    first, *rest = pictures
    first.save(out, save_all=True, append_images=rest, duration=FRAME_MS, loop=0, quality=QUALITY, method=6)


def decoded(source: str) -> Image.Image:
    """Return the picture that a page holds as ``data:``."""
    return Image.open(io.BytesIO(base64.b64decode(source.partition(",")[2])))


def beside(left: Image.Image, right: Image.Image) -> Image.Image:
    """Return two pictures side by side."""
    both = Image.new("RGB", (left.width + right.width, max(left.height, right.height)))
    both.paste(left, (0, 0))
    both.paste(right, (left.width, 0))
    return both


if __name__ == "__main__":
    main()

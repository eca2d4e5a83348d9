"""What ``make demo`` runs: simulate a few short recordings, build them, and look at the results.

Every step is the command that a user would type; it is printed before it runs.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

DEMO = Path("demo")
DEPTH, COLOR = "GreenTowel_Ruler_01_pi16_0.5_R1", "GreenTowel_Corner_01_pi16_0.5_B1"
GARMENT = str(Path(sys.executable).with_name("garment"))


def garment(*arguments: object) -> None:
    """Print a command and run it."""
    words = [str(argument) for argument in arguments]
    print(f"\n$ garment {shlex.join(words)}", flush=True)
    subprocess.run([GARMENT, *words], check=True)


def main() -> None:
    """Run the demo from the beginning, or what is left of it: a second run has next to nothing to do."""
    if not (DEMO / "catalog").is_dir():
        garment("init", DEMO)
    here = ("--workspace", DEMO)
    if not (DEMO / "recordings" / f"{COLOR}.bag").is_file():
        garment("simulate", "--set", "demo", "--scale", "small", "--out", DEMO / "recordings")
    garment("list", "state=present", *here)
    garment("build", *here)
    garment("show", DEPTH, "--frame", 45, "--save", DEMO / "depth.png", *here)
    garment("show", COLOR, "--frame", 45, "--save", DEMO / "colour.png", *here)
    garment("plot", "axis=R", "--save", DEMO / "motion.png", *here)
    garment("report", *here)
    pictures = ", ".join(str(path) for path in sorted(DEMO.glob("*.png")))
    print(
        f"""
Built: Parquet tables in {DEMO / "features"}, pictures {pictures}

Try next (after `source .venv/bin/activate && cd {DEMO}`):
  garment why {DEPTH}    what each result was made from, and whether it is still right
  garment dag --params    every knob; change one in pipelines/depth.toml, then `garment build`
  python -c "from garment_dataset import load_features; print(load_features('kinematics').describe())"

All of it on pages that a browser opens, without a network: {(DEMO / "report" / "index.html").resolve()}
"""
    )


if __name__ == "__main__":
    main()

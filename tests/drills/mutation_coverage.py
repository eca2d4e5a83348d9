"""Run the package's stages on two recordings in a fresh interpreter; write which lines each runs, and what it makes.

Arguments: the folder that holds the package, the depth and the colour recording, ``lines`` or ``results``, and a file
to write. Lines are told apart by when they run: while a module is imported, or not.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from types import FrameType

# what each stage reads besides its bag comes from the stages before it
DEPTH = ("decode", "depth_points", "kinematics", "motion", "quality")
COLOR = ("decode", "background", "silhouette", "central_curve")


class Lines:
    """The lines of one package that run, by file, while a stage does."""

    def __init__(self, package: Path) -> None:
        self._prefix = f"{package}/"
        self._imports = 0
        self.found: dict[str, dict[str, set[int]]] = {"run": {}, "import": {}}

    def trace(self, frame: FrameType, event: str, _: object) -> Any:
        name = frame.f_code.co_filename
        if event != "call" or not name.startswith(self._prefix):
            return None
        is_module = frame.f_code.co_name == "<module>"
        self._imports += is_module
        file = name.removeprefix(self._prefix)

        def local(frame: FrameType, event: str, _: object) -> Any:
            if event == "line":
                kind = "import" if self._imports else "run"
                self.found[kind].setdefault(file, set()).add(frame.f_lineno)
            elif event == "return":
                self._imports -= is_module
            return local

        return local


def run(stage: Any, bag: Path, tables: dict[str, Any]) -> dict[str, Any]:
    """Call a stage's function with what there is."""
    arguments: dict[str, Any] = {"params": stage.params()}
    for name, parameter in inspect.signature(stage.function).parameters.items():
        if name == "bag":
            arguments[name] = bag
        elif name == "notes":
            arguments[name] = {}
        elif name in tables:
            arguments[name] = tables[name]
        elif name != "params":
            assert parameter.default is not inspect.Parameter.empty, f"{stage.name} wants {name}"
    return dict(stage.function(**arguments))


def labelled(made: dict[str, Any]) -> dict[str, Any]:
    """Return tables with the identity column that stages look at."""
    return {name: table.append_column("axis", [["R"] * table.num_rows]) for name, table in made.items()}


def digest_of(made: dict[str, Any]) -> str:
    text = repr([(name, table.to_pydict()) for name, table in sorted(made.items())])
    return hashlib.sha256(text.encode()).hexdigest()


def main() -> None:
    folder, depth_bag, color_bag, what, output = sys.argv[1:]
    sys.path.insert(0, folder)
    sys.dont_write_bytecode = True
    warnings.simplefilter("ignore")
    found: dict[str, Any] = {}
    import importlib

    for chain, bag in ((DEPTH, depth_bag), (COLOR, color_bag)):
        tables: dict[str, Any] = {}
        for name in chain:
            lines = Lines(Path(folder) / "garment_dataset")
            if what == "lines":
                for module in [each for each in sys.modules if each.startswith("garment_dataset")]:
                    del sys.modules[module]  # so that each stage runs the imports that it causes
                sys.settrace(lines.trace)
            try:
                stage = importlib.import_module(f"garment_dataset.stages.{name}").STAGE
                made = run(stage, Path(bag), tables)
            finally:
                sys.settrace(None)
            tables |= labelled(made)
            of_stage = found.setdefault(name, {"results": []})
            of_stage["results"].append(digest_of(made))
            for kind, by_file in lines.found.items():
                for file, numbers in by_file.items():
                    of_file = of_stage.setdefault(kind, {}).setdefault(file, [])
                    of_file[:] = sorted({*of_file, *numbers})
    Path(output).write_text(json.dumps(found), "utf-8")


if __name__ == "__main__":
    main()

"""The engine, with what a table is, lives without the product: lifted out, it runs a domain of a few lines."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import garment_dataset.engine

ENGINE = Path(garment_dataset.engine.__file__).parent
WORDS = '''
"""One text, word by word."""

from pathlib import Path

from lifted.stage import Stage, StageParams
from lifted.table import Column, TableSpec

WORDS = TableSpec("words", 1, "one word", (Column("word", "string", "", "as written"),))


class WordsParams(StageParams):
    least_letters: int = 1


def words(text: Path, params: WordsParams):
    found = [word for word in text.read_text().split() if len(word) >= params.least_letters]
    return {"words": WORDS.table({"word": found})}


STAGE = Stage(words, WordsParams, (WORDS,), frozenset({"text"}))
'''
LENGTHS = '''
"""All texts together."""

from lifted.stage import Stage, StageParams
from lifted.table import Column, TableSpec

LENGTHS = TableSpec("lengths", 1, "one text", (Column("words", "int64", "1", "number of words"),))


def lengths(words, params: StageParams):
    return {"lengths": LENGTHS.table({"words": [table.num_rows for table in words.values()]})}


STAGE = Stage(lengths, StageParams, (LENGTHS,))
'''
SCRIPT = """
import sys
from pathlib import Path


class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "garment_dataset":
            raise ImportError("the product is not here")


sys.meta_path.insert(0, Blocker())
root = Path(sys.argv[1])
sys.path.insert(0, str(root))

import importlib

from lifted.code import CodeCache
from lifted.executors import Pool, local_executor
from lifted.graph import Graph, Node, NodeId
from lifted.plan import make_plan
from lifted.options import Options
from lifted.run import Run
from lifted.store import Store
from lifted.table import Column, Label

NAME = Column("text", "string", "", "which text")


def build():
    stages = [importlib.import_module(f"texts.{name}").STAGE for name in ("words", "lengths")]
    texts = sorted((root / "sources").glob("*.txt"))
    labels = {text: (Label(NAME, text.stem),) for text in texts}
    nodes = [Node(stages[0], text.stem, stages[0].params(), {"text": text}, labels=labels[text]) for text in texts]
    nodes.append(Node(stages[1], "all", stages[1].params(), gathers={"words": tuple(node.id for node in nodes)}))
    graph, store = Graph(nodes), Store(root / "private", root / "results")
    cache = CodeCache(root / "private" / "code", {"lifted": root / "lifted", "texts": root / "texts"})
    codes = cache.codes(stages)
    plan = make_plan(graph, codes, store)
    print("plan", *(f"{one.node}={one.state}" for one in plan))
    print("why", *(str(reason).split(":")[0] for one in plan for reason in one.reasons), sep="|")
    run = Run(
        graph,
        plan,
        codes=codes,
        code_cache=cache,
        store=store,
        pool=Pool(lambda: local_executor(0)),
        options=Options(),
        emit=lambda event: None,
    )
    print("run", *(f"{event.node}={event.ending}" for event in run.finish().events.values()))
    store.close()


build()
build()
(root / "sources" / "b.txt").write_text("four words are here")
build()

import pyarrow.parquet as pq

print("result", pq.ParquetFile(root / "results" / "lengths" / "all.parquet").read()["words"].to_pylist())
assert not any(name.partition(".")[0] == "garment_dataset" for name in sys.modules)
"""


def test_it_runs_without_the_product(tmp_path: Path) -> None:
    for path in ENGINE.rglob("*.py"):
        target = tmp_path / "lifted" / path.relative_to(ENGINE)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(path.read_text("utf-8").replace("garment_dataset.engine", "lifted"), "utf-8")
    (tmp_path / "texts").mkdir()
    (tmp_path / "texts" / "__init__.py").touch()
    (tmp_path / "texts" / "words.py").write_text(WORDS)
    (tmp_path / "texts" / "lengths.py").write_text(LENGTHS)
    (tmp_path / "sources").mkdir()
    (tmp_path / "sources" / "a.txt").write_text("one two three")
    (tmp_path / "sources" / "b.txt").write_text("one")
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "plan words:a=missing words:b=missing lengths:all=missing"
    assert lines[2] == "run words:a=built words:b=built lengths:all=built"
    assert lines[3] == "plan words:a=fresh words:b=fresh lengths:all=fresh"
    assert lines[5] == "run words:a=fresh words:b=fresh lengths:all=fresh"
    assert lines[6] == "plan words:a=fresh words:b=stale lengths:all=stale"
    assert lines[7].startswith("why|source text")
    assert lines[8] == "run words:a=fresh words:b=built lengths:all=built"
    assert lines[9] == "result [3, 4]"


@pytest.mark.parametrize("path", sorted(ENGINE.rglob("*.py")), ids=lambda path: path.name)
def test_no_word_of_the_product_is_in_it(path: Path) -> None:
    text = path.read_text("utf-8").replace("garment_dataset.engine", "")
    found = re.findall(r"(?i)\b\w*(?:garment|recording|background|rosbag|gripper)\w*|\bbags?\b", text)
    assert found == []

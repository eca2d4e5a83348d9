"""What one statement of a module says: its canonical form, and all that it refers to."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.definitions import DEFINITIONS
from garment_dataset.engine.codebase.expressions import EXPRESSIONS
from garment_dataset.engine.codebase.writer import Writer
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from garment_dataset.engine.codebase.modules import Module, Modules
    from garment_dataset.engine.codebase.references import Facts
    from garment_dataset.engine.codebase.statements import Statement

_HANDLERS = {**DEFINITIONS, **EXPRESSIONS}


def facts_of(modules: Modules, module: Module, statement: Statement, fieldless: frozenset[str]) -> Facts:
    """Return what one statement of a module says.

    Parameters
    ----------
    modules : Modules
        All first-party code.
    module : Module
        The one it stands in.
    statement : Statement
        The statement.
    fieldless : frozenset of str
        Classes that it defines whose fields are left out: only their annotations are followed.
    """
    writer = Writer(modules, module, fieldless, _HANDLERS)
    try:
        writer.write(statement.node)
    except RecursionError:
        writer.refuse(UntraceableCodeError("nested too deeply to be followed"), statement.node)
    except UntraceableCodeError as error:
        writer.refuse(error, statement.node)
    facts = writer.names.facts
    facts.digest = hashlib.sha256("".join(writer.out).encode("ascii")).hexdigest()
    return facts

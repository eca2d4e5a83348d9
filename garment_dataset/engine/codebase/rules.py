"""What cannot be followed statically, and how it is refused."""

from __future__ import annotations

from garment_dataset.engine.errors import UntraceableCodeError

_BY_NAME = "Call or import it by name; a dict of functions serves where the choice is made at run time"
_AS_CONSTANT = "Make it a constant of the code, a parameter or an input"

_REFUSED = {
    "builtins.eval": _BY_NAME,
    "builtins.exec": _BY_NAME,
    "builtins.compile": _BY_NAME,
    "builtins.__import__": _BY_NAME,
    "builtins.globals": _BY_NAME,
    "builtins.locals": _BY_NAME,
    "builtins.__builtins__": _BY_NAME,
    "builtins.__file__": _AS_CONSTANT,
    "builtins.__path__": _AS_CONSTANT,
    "builtins.__spec__": _AS_CONSTANT,
    "builtins.__loader__": _AS_CONSTANT,
    "builtins.__cached__": _AS_CONSTANT,
    "importlib": _BY_NAME,
    "importlib.resources": _AS_CONSTANT,
    "pkgutil": _BY_NAME,
    "pkgutil.get_data": _AS_CONSTANT,
    "runpy": _BY_NAME,
    "pydoc.locate": _BY_NAME,
    "gc.get_objects": _BY_NAME,
    "sys.modules": _BY_NAME,
    "__main__": "Put it into a module of the package",
}
_ALLOWED = ("importlib.metadata",)

REFUSED_ATTRIBUTES = frozenset({"__subclasses__", "__globals__", "__builtins__", "f_globals", "f_locals", "__loader__"})
"""Ways from an object to code that nothing names."""

MODULE_VARIABLES = frozenset(name.removeprefix("builtins.") for name in _REFUSED if name.startswith("builtins.__"))
"""Names that every module has without defining them, and that say where it is."""

MODULE_FUNCTIONS = frozenset(f"builtins.{name}" for name in ("getattr", "setattr", "delattr", "hasattr", "vars", "dir"))
"""Builtins that reach into a module when they are given one."""


def refusal_of(dotted: str) -> UntraceableCodeError | None:
    """Return why something external may not be used, or None when it may."""
    if any(f"{dotted}.".startswith(f"{allowed}.") for allowed in _ALLOWED):
        return None
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        if (hint := _REFUSED.get(".".join(parts[:count]))) is not None:
            return UntraceableCodeError(
                "cannot be followed statically", found=dotted.removeprefix("builtins."), hint=hint
            )
    return None


def module_as_value(module: str, function: str | None = None) -> UntraceableCodeError:
    """Return the refusal of a first-party module that is used as a value, perhaps as an argument of ``function``."""
    return UntraceableCodeError(
        "a module is handed on as a value" if function is None else f"{function}() on a module",
        found=module,
        hint="Write module.name, or keep the functions in a dict",
    )


def located(error: UntraceableCodeError, where: str) -> UntraceableCodeError:
    """Return the refusal with its place, unless it has one."""
    if error.where is not None:
        return error
    return UntraceableCodeError(error.what, where=where, expected=error.expected, found=error.found, hint=error.hint)


def reached_through(error: UntraceableCodeError, chain: list[str]) -> UntraceableCodeError:
    """Return the refusal with the way that leads to it."""
    way = f"Reached through {' -> '.join(chain)}"
    hint = way if error.hint is None else f"{error.hint}. {way}"
    return UntraceableCodeError(error.what, where=error.where, expected=error.expected, found=error.found, hint=hint)

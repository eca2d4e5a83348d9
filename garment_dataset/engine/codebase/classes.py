"""What a first-party class shows of itself: whether making an object of it only stores, and whether that can change."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.modules import External, Symbol
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from garment_dataset.engine.codebase.modules import Module, Modules, Target

FROZEN_BASES = frozenset({"NamedTuple", "Enum", "IntEnum", "StrEnum", "Flag", "IntFlag"})
_PLAIN_BASES = FROZEN_BASES | {"object", "Protocol", "Generic", "ABC", "TypedDict", "Exception"}
_PLAIN_DECORATORS = frozenset({"dataclass", "final", "runtime_checkable", "total_ordering", "unique"})
_FROZEN_TYPES = frozenset({*(f"builtins.{name}" for name in ("str", "int", "float", "bool", "bytes")), "pathlib.Path"})
_HOOKS = frozenset({"__new__", "__post_init__", "__init_subclass__", "__setattr__", "__set__", "setter"})
_MAKERS = frozenset({"__init__", "__new__", "__post_init__"})
_CONTAINERS = frozenset({"dict", "list", "set", "tuple", "frozenset", "field"})


def only_stores(modules: Modules, symbol: Symbol, within: frozenset[Symbol] = frozenset()) -> bool:
    """Say whether a symbol is a class that does nothing to what its objects are made of but keep it.

    Parameters
    ----------
    modules : Modules
        All first-party code.
    symbol : Symbol
        The class.
    within : frozenset of Symbol
        The classes that are being looked at: one that leads to itself tells nothing new.
    """
    module = modules.module(symbol.module)
    return all(
        isinstance(each.node, ast.ClassDef)
        and _definition_only_stores(each.node)
        and all(_base_only_stores(modules, module, base, within | {symbol}) for base in each.node.bases)
        for each in module.symbols[symbol.name]
    )


def _definition_only_stores(node: ast.ClassDef) -> bool:
    if node.keywords or any(last_name(_called(each)) not in _PLAIN_DECORATORS for each in node.decorator_list):
        return False
    for item in node.body:
        if isinstance(item, ast.FunctionDef):
            if item.name in _HOOKS or any(last_name(each) in _HOOKS for each in item.decorator_list):
                return False
            if item.name == "__init__" and not all(_is_plain_store(each) for each in item.body):
                return False
    return True


def may_call_its_arguments(modules: Modules, symbol: Symbol, within: frozenset[Symbol] = frozenset()) -> bool:
    """Say whether a symbol is no class, or a class that may call what its objects are made of while it makes them."""
    module = modules.module(symbol.module)
    for each in module.symbols[symbol.name]:
        if not isinstance(each.node, ast.ClassDef) or each.node.keywords:
            return True
        methods = {item.name: item for item in each.node.body if isinstance(item, ast.FunctionDef)}
        if any(_calls_a_value(methods[name], methods) for name in _MAKERS & methods.keys()):
            return True
        bases = [target_of(modules, module, base) for base in each.node.bases]
        own = [base for base in bases if isinstance(base, Symbol) and base not in within]
        if any(may_call_its_arguments(modules, base, within | {symbol}) for base in own):
            return True
    return False


def _calls_a_value(node: ast.FunctionDef, methods: Mapping[str, ast.FunctionDef]) -> bool:
    arguments = {each.arg for each in [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]}
    for each in ast.walk(node):
        match each:
            case ast.Call(func=ast.Name(id=name)) if name in arguments:
                return True
            case ast.Call(func=ast.Attribute(value=ast.Name(id="self"), attr=name)) if name not in methods:
                return True
    return False


def may_act_on_subclasses(modules: Modules, symbol: Symbol, within: frozenset[Symbol] = frozenset()) -> bool:
    """Say whether a symbol may run code of its own when a class is derived from it; if it is no class, it may."""
    module = modules.module(symbol.module)
    for each in module.symbols[symbol.name]:
        if not isinstance(each.node, ast.ClassDef) or each.node.keywords:
            return True
        if any(isinstance(item, ast.FunctionDef) and item.name == "__init_subclass__" for item in each.node.body):
            return True
        bases = [target_of(modules, module, base) for base in each.node.bases]
        own = [base for base in bases if isinstance(base, Symbol) and base not in within]
        if any(may_act_on_subclasses(modules, base, within | {symbol}) for base in own):
            return True
    return False


def _base_only_stores(modules: Modules, module: Module, base: ast.expr, within: frozenset[Symbol]) -> bool:
    if isinstance(base, ast.Subscript):
        base = base.value
    target = target_of(modules, module, base)
    if isinstance(target, Symbol):
        return target in within or only_stores(modules, target, within)
    return isinstance(target, External) and target.dotted.rpartition(".")[2] in _PLAIN_BASES


def _is_plain_store(node: ast.stmt) -> bool:
    """Say whether a statement of ``__init__`` puts something into the object, and no more."""
    match node:
        case ast.Pass() | ast.Expr(value=ast.Constant()):
            return True
        case ast.Expr(value=ast.Call(func=ast.Attribute(value=ast.Call(func=ast.Name("super")), attr="__init__"))):
            return True
        case ast.Assign(targets=targets, value=value):
            return all(_is_attribute(each) for each in targets) and _calls_nothing(value)
        case ast.AnnAssign(target=target, value=value):
            return _is_attribute(target) and (value is None or _calls_nothing(value))
        case _:
            return False


def _is_attribute(node: ast.expr) -> bool:
    if isinstance(node, ast.Tuple):
        return all(_is_attribute(each) for each in node.elts)
    return isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)


def _calls_nothing(node: ast.expr) -> bool:
    return all(last_name(each.func) in _CONTAINERS for each in ast.walk(node) if isinstance(each, ast.Call))


def is_enumeration(node: ast.stmt) -> bool:
    """Say whether a statement defines a class whose attributes are members that never change."""
    return isinstance(node, ast.ClassDef) and any(
        (last_name(base) or "").endswith(("Enum", "Flag")) for base in node.bases
    )


def is_frozen(node: ast.stmt) -> bool:
    """Say whether a statement defines a class whose objects never change, as long as what they are made of does not."""
    if not isinstance(node, ast.ClassDef):
        return False
    is_declared = any(last_name(base) in FROZEN_BASES for base in node.bases) or any(
        isinstance(each, ast.Call)
        and last_name(each.func) == "dataclass"
        and any(
            word.arg == "frozen" and isinstance(word.value, ast.Constant) and word.value.value is True
            for word in each.keywords
        )
        for each in node.decorator_list
    )
    return is_declared and not any(_may_hold_more(each) for each in node.body)


def is_declared_frozen(modules: Modules, symbol: Symbol, within: frozenset[Symbol] = frozenset()) -> bool:
    """Say whether a symbol is a frozen class, all of whose fields are declared as what never changes."""
    module = modules.module(symbol.module)
    return all(
        is_frozen(each.node)
        and all(
            _is_declared_frozen(modules, module, item.annotation, within | {symbol})
            for item in ast.iter_child_nodes(each.node)
            if isinstance(item, ast.AnnAssign)
        )
        for each in module.symbols[symbol.name]
    )


def _is_declared_frozen(modules: Modules, module: Module, node: ast.expr, within: frozenset[Symbol]) -> bool:
    match node:
        case ast.Constant(value=str(text)):
            return _is_declared_frozen(modules, module, _quoted(text), within)
        case ast.BinOp(left=left, right=right):
            return all(_is_declared_frozen(modules, module, each, within) for each in (left, right))
        case ast.Subscript(value=ast.Name(id="tuple" | "frozenset"), slice=part):
            parts = part.elts if isinstance(part, ast.Tuple) else [part]
            return all(_is_declared_frozen(modules, module, each, within) for each in parts)
        case ast.Constant() | ast.Subscript(value=ast.Name(id="Literal")):
            return True
        case _:
            return _is_frozen_type(modules, target_of(modules, module, node), within)


def _quoted(text: str) -> ast.expr:
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError):
        return ast.List([])  # no annotation, and nothing frozen


def _is_frozen_type(modules: Modules, target: Target | None, within: frozenset[Symbol]) -> bool:
    if isinstance(target, External):
        return target.dotted in _FROZEN_TYPES
    if not isinstance(target, Symbol):
        return False
    statements = modules.module(target.module).symbols[target.name]
    if target in within or all(is_enumeration(each.node) for each in statements):
        return True
    return is_declared_frozen(modules, target, within)


def _may_hold_more(node: ast.stmt) -> bool:
    """Say whether a statement of a class gives its objects something that can change."""
    match node:
        case ast.Assign(value=value) | ast.AnnAssign(value=ast.expr() as value):
            return any(_is_mutable(each) for each in ast.walk(value))
        case ast.FunctionDef(decorator_list=decorators):
            words = {last_name(_called(each)) for each in decorators}
            return "cached_property" in words or any(_sets_attribute(each) for each in ast.walk(node))
        case _:
            return False


def _is_mutable(node: ast.AST) -> bool:
    if isinstance(node, ast.Call):
        return last_name(node.func) not in {"field", "tuple", "frozenset", "auto", "float", "int"} or any(
            word.arg == "default_factory" for word in node.keywords
        )
    return isinstance(node, ast.List | ast.Dict | ast.Set | ast.ListComp | ast.DictComp | ast.SetComp)


def _sets_attribute(node: ast.AST) -> bool:
    return isinstance(node, ast.Attribute) and node.attr in {"__setattr__", "__dict__"}


def target_of(modules: Modules, module: Module, node: ast.expr) -> Target | None:
    """Return what a name or a chain of attributes at the top of a module stands for; None for a value, or nothing."""
    try:
        if isinstance(node, ast.Name):
            return modules.resolve(module, node.id, set())
        if isinstance(node, ast.Attribute):
            base = target_of(modules, module, node.value)
            if isinstance(base, External):
                return External(f"{base.dotted}.{node.attr}")
            if base is not None and not isinstance(base, Symbol):
                return modules.attribute(base.module, node.attr, set())
    except UntraceableCodeError:
        pass  # refused where the code is written out
    return None


def last_name(node: ast.expr) -> str | None:
    """Return the name, or the last name of a dotted one; None for any other expression."""
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
        case _:
            return None


def _called(node: ast.expr) -> ast.expr:
    return node.func if isinstance(node, ast.Call) else node

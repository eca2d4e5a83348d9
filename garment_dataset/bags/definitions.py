"""Message definitions as recordings carry them, and the types that they make."""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat, Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rosbags.interfaces.typing import Typesdict
    from rosbags.typesys.store import Typestore

UNREADABLE = (
    *(SerdeError, TypesysError, AssertionError, ValueError, LookupError, ArithmeticError, struct.error),
    SyntaxError,
)
"""What reading a message may raise: rosbags raises the first two on purpose; the others escape from its generated code
and its assertions."""


def reason(error: BaseException) -> str:
    """Return what an exception says; failed assertions say nothing but their name."""
    return str(error) or type(error).__name__


@lru_cache(maxsize=256)
def typestore_of(message_type: str, definition: MessageDefinition) -> Typestore | str:
    """Return a store that knows ``message_type`` by this definition and no other, or why it cannot be used.

    Publishers of one topic may differ in their definitions, so each gets its own store; kept from bag to bag, because
    generating the code of one takes some 20 ms. Old rosbag2 storage has no definitions: the types of ROS 2 Humble, the
    last distribution to write it, stand in.
    """
    if definition.format is not MessageDefinitionFormat.MSG:
        return get_typestore(Stores.ROS2_HUMBLE)
    store = get_typestore(Stores.EMPTY)
    try:
        types = get_types_from_msg(definition.data, message_type)
        _add_parts(types)
        _check_definition(types)
        store.register(types)
    except UNREADABLE as error:
        return reason(error)
    return store


_HEADER = "std_msgs/msg/Header"
_TRANSFORM = "geometry_msgs/msg/TransformStamped"


@lru_cache(maxsize=256)
def has_common_transforms(message_type: str, definition: MessageDefinition) -> bool:
    """Return whether messages of this definition are a list of transforms, each exactly as ROS 1 defines it."""
    store, (common, _) = typestore_of(message_type, definition), _common_types()
    if isinstance(store, str) or message_type not in store.fielddefs:
        return False
    fields = [kind for _, kind in store.fielddefs[message_type][1]]
    if fields != [(Nodetype.SEQUENCE, ((Nodetype.NAME, _TRANSFORM), 0))]:
        return False
    pending, types = [_TRANSFORM], set[str]()
    while pending:
        name = pending.pop()
        if store.fielddefs.get(name, ())[1:] != common.fielddefs[name][1:]:
            return False
        types.add(name)
        pending += set(_parts(common.fielddefs, name)) - types
    return True


Leading = Literal["header", "headers"]
"""What a message begins with: a header, or the number of its parts, each of which begins with one, as transforms do."""


@lru_cache(maxsize=256)
def leading_header(message_type: str, definition: MessageDefinition) -> Leading | None:
    """Return how messages of this definition begin; None when not with a header, or when it cannot be used."""
    store = typestore_of(message_type, definition)
    if isinstance(store, str) or message_type not in store.fielddefs:
        return None
    fields = store.fielddefs[message_type][1]
    first = fields[0][1] if fields else None
    if first == (Nodetype.NAME, _HEADER):
        return "header"
    if first is None or first[0] != Nodetype.SEQUENCE or first[1][0][0] != Nodetype.NAME:
        return None
    parts = store.fielddefs[str(first[1][0][1])][1]
    return "headers" if parts and parts[0][1] == (Nodetype.NAME, _HEADER) else None


def _check_definition(types: Typesdict) -> None:
    """Refuse definitions of common types that lack a field, or have it as something else.

    A damaged definition may well be readable: by it, another number would be read, or a field be missing where it is
    used. Further fields are no damage.
    """
    for name, (_, fields) in types.items():
        found = dict(fields)
        known = [store.fielddefs[name][1] for store in _common_types() if name in store.fielddefs]
        if known and not any(all(found.get(each) == kind for each, kind in common) for common in known):
            raise TypesysError(f"The definition of {name} lacks fields of the common one.")


@lru_cache(maxsize=1)
def _common_types() -> tuple[Typestore, ...]:
    return get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)


def _add_parts(types: Typesdict) -> None:
    """Add the common definitions of types that are used and not defined: some recorders write the outermost alone."""
    common, _ = _common_types()
    pending = list(types)
    while pending:
        for name in _parts(types, pending.pop()):
            if name not in types and name in common.fielddefs:
                types[name] = common.fielddefs[name]
                pending.append(name)


def _parts(types: Typesdict, name: str) -> Iterator[str]:
    """Yield the names of the types that one is made of."""
    for _, (kind, said) in types[name][1]:
        inner = said[0] if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else (kind, said)
        if isinstance(inner, tuple) and inner[0] == Nodetype.NAME:
            yield str(inner[1])


def definition_digest(definition: str, message_type: str) -> str | None:
    """Return the MD5 sum that ROS 1 gives a definition; None if it cannot be read."""
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(definition, message_type))
        name = next(iter(get_types_from_msg(definition, message_type)))
        return store.generate_msgdef(name)[1]
    except UNREADABLE:
        return None

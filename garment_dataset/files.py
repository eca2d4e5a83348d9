"""Files that a person writes: read whatever they are, and what is wrong with what they say; and files written whole."""

from __future__ import annotations

import codecs
import contextlib
import os
import re
import reprlib
import stat
import tomllib
from typing import TYPE_CHECKING, Any, NamedTuple, get_args, get_origin

from pydantic import BaseModel

from garment_dataset.errors import did_you_mean, one_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pydantic import ValidationError

_MAX_DEPTH = 100
"""Parts of a dotted key; the deepest that means something has three."""

_MARKS = {
    codecs.BOM_UTF32_LE: "UTF-32",  # begins like UTF-16's, and comes before it
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}
_SAVE_AS = "Save it as UTF-8: Excel calls that 'CSV UTF-8', editors 'encoding'."


class EncodingError(ValueError):
    """Bytes that are no text in UTF-8; the message says what they are, the hint how to save them instead."""

    def __init__(self, found: str, hint: str = _SAVE_AS) -> None:
        super().__init__(found)
        self.hint = hint


def hint_of(error: Exception) -> str | None:
    """Return what to do about a file that could not be read, where the error says it."""
    return error.hint if isinstance(error, EncodingError) else None


def read_text(path: Path, max_bytes: int = 100_000_000) -> str:
    """Read a file that a person wrote; editors on Windows put a byte order mark in front.

    Raises
    ------
    OSError
        If it cannot be read, or is no file: a pipe or a device would be waited for, or read for ever.
    ValueError
        If it has more bytes than such a file can have, or is not in UTF-8 (:class:`EncodingError`).
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise OSError("a folder" if stat.S_ISDIR(status.st_mode) else "a pipe or a device, and no file")
    if status.st_size > max_bytes:
        raise ValueError(f"{status.st_size} bytes, and it may have {max_bytes}")
    text = _decoded(path.read_bytes())
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _decoded(raw: bytes) -> str:
    """Return bytes as text, or say what they are instead: spreadsheets and old editors write other encodings."""
    for mark, encoding in _MARKS.items():
        if raw.startswith(mark):
            raise EncodingError(f"{encoding}: it begins with the bytes {mark.hex(' ')}")
    if (zero := raw.find(b"\0")) >= 0:
        # text in UTF-16 has a zero in every other byte
        likely = raw.count(b"\0") > len(raw) / 4
        what = "UTF-16 without its mark, or no text" if likely else "a character that no text has"
        raise EncodingError(f"a zero byte in {_line_of(raw, zero)}: {what}")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        letter = raw[error.start : error.start + 1].decode("cp1252", errors="replace")
        found = f"byte 0x{raw[error.start]:02x} in {_line_of(raw, error.start)}"
        raise EncodingError(f"{found}: no UTF-8; in Windows-1252 it is {letter!r}") from error


def _line_of(raw: bytes, place: int) -> str:
    return f"line {raw.count(bytes([10]), 0, place) + 1}"


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it is no TOML, not in UTF-8, or of a depth that no reader of TOML can take in.
    """
    text = read_text(path, max_bytes=1_000_000)
    # tomllib takes minutes over keys of very many parts
    if max(map(len, (piece.split(".") for piece in re.split(r"[\n,=\[\]{}#]", text)))) > _MAX_DEPTH:
        raise ValueError(f"a key of more than {_MAX_DEPTH} parts")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield the name of a file beside ``path`` that takes its place when it is finished, and is gone when it fails.

    Parameters
    ----------
    path : Path
        Where the file is to be, whole or not at all; one that is there is replaced.

    Raises
    ------
    OSError
        If it cannot be written there; it names the file.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        if error.filename is None:  # a full disk says only that it is full
            error.filename = str(path)
        raise
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


class Fault(NamedTuple):
    """The first thing wrong with what a file says: which entry, what it may be, what it is, and what may be meant."""

    entry: str
    expected: str
    found: str | None
    hint: str | None


def first_fault(error: ValidationError, model: type[BaseModel]) -> Fault:
    """Return what is wrong with a file's entries; a name that is not known comes before one that is missing.

    Parameters
    ----------
    error : ValidationError
        Of the model, which has at least one error.
    model : type of BaseModel
        What the file was read as.
    """
    faults = error.errors(include_url=False)
    fault = next((each for each in faults if each["type"] == "extra_forbidden"), faults[0])
    entry, kind = ".".join(str(part) for part in fault["loc"]), fault["type"]
    last, found = str(fault["loc"][-1]) if fault["loc"] else "", reprlib.repr(fault.get("input"))
    if kind == "extra_forbidden":
        known = _fields_at(model, fault["loc"][:-1])
        return Fault(entry, one_of(known), repr(last), did_you_mean(last, known))
    if kind == "literal_error":
        known = re.findall(r"'([^']*)'", fault["ctx"]["expected"])
        return Fault(entry, one_of(known), found, did_you_mean(str(fault["input"]), known))
    return Fault(entry, fault["msg"], None if kind == "missing" else found, None)


def _fields_at(model: type[BaseModel], path: tuple[str | int, ...]) -> list[str]:
    """Return the names that a table of a file may have."""
    place: object = model
    for part in path:
        inner = _model_in(place)
        if inner is not None:
            field = inner.model_fields.get(str(part))
            place = None if field is None else field.annotation
        else:  # a table whose names are free: what each of them stands for
            place = get_args(place)[1] if get_origin(place) is dict else None
    found = _model_in(place)
    return [] if found is None else list(found.model_fields)


def _model_in(annotation: object) -> type[BaseModel] | None:
    """Return the model that an annotation is, or that it is one of with None."""
    for each in (annotation, *get_args(annotation)):
        if isinstance(each, type) and issubclass(each, BaseModel) and get_origin(annotation) is not dict:
            return each
    return None

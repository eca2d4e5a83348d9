"""What is written to stdout and stderr, whatever the terminal, its encoding and the names of files are.

File names and cells of tables come from anywhere. No control letter of theirs reaches a terminal, none that the
stream's encoding lacks is an error, and a reader that has gone (``garment list | head -1``) ends the command without a
word.
"""

from __future__ import annotations

import codecs
import io
import os
import sys
from typing import TYPE_CHECKING, cast

from garment_dataset import interrupts
from garment_dataset.errors import printable

if TYPE_CHECKING:
    from typing import Any, BinaryIO

REPLACING = "garment_dataset.replacing"
"""Name of the handler of encoding errors: our own signs in the letters of ASCII, all others as escapes."""

_PLAIN = str.maketrans(
    {
        **dict(zip("×µ·–—‘’“”\xa0", "xu*--''\"\" ", strict=True)),
        "°": "deg",
        "²": "^2",
        "±": "+-",
        "…": "...",
        "→": "->",
        "≤": "<=",
        "≥": ">=",
    }
)
_KEPT = "\n\t"
_WITHOUT_KEPT = {ord(each): None for each in _KEPT}


def _replace(error: UnicodeError) -> tuple[str | bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return lacking.translate(_PLAIN).encode("ascii", "backslashreplace").decode(), error.end


codecs.register_error(REPLACING, _replace)


class SafeStream(io.TextIOWrapper):
    """A text stream that writes control letters as escapes, new line and tabulator excepted.

    A reader that has gone ends the process as a signal does; anything else that cannot be written is an ``OSError``
    that names the stream, and what is written afterwards is dropped.
    """

    def write(self, text: str, /) -> int:
        """Write a text, control letters as escapes."""
        if text == "":  # to write nothing is an error on some devices
            return 0
        try:
            return super().write(_shown(text))
        except OSError as error:
            raise self._lost(error) from error

    @property
    def buffer(self) -> BinaryIO:
        """There is none: Typer would write UTF-8 past this stream where its encoding is ASCII."""
        raise AttributeError("buffer")

    def flush(self) -> None:
        """Hand everything on to the system."""
        try:
            super().flush()
        except OSError as error:
            raise self._lost(error) from error

    def _lost(self, error: OSError) -> OSError:
        if isinstance(error, BrokenPipeError):
            interrupts.end_for_broken_pipe()
        # what is still in the buffer would be tried again when Python ends
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.fileno())
        os.close(nowhere)
        return OSError(error.errno, error.strerror, self.name)


def make_streams_safe() -> None:
    """Put safe streams in the place of stdout and stderr; what is written to closed ones is dropped."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(_occupied(number), "w", encoding="utf-8", errors=REPLACING))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper) and not isinstance(stream, SafeStream):
            setattr(sys, name, _safe(stream))


def legible(text: str, stream: Any = None) -> str:  # noqa: ANN401 - whatever stands for stdout
    """Return a text as it will stand on a stream, on one line: what has no letter there as escapes.

    Parameters
    ----------
    text : str
        Any text.
    stream : text stream, optional
        Where it is to be written; stdout by default.
    """
    text = printable(text)
    encoding = getattr(sys.stdout if stream is None else stream, "encoding", None) or "utf-8"
    return text if text.isascii() else text.encode(encoding, REPLACING).decode(encoding)


def is_unicode(stream: Any = None) -> bool:  # noqa: ANN401
    """Say whether all letters there are can be written to a stream; stdout by default."""
    encoding = getattr(sys.stdout if stream is None else stream, "encoding", None) or "utf-8"
    return codecs.lookup(encoding).name.startswith("utf")


def _shown(text: str) -> str:
    if text.translate(_WITHOUT_KEPT).isprintable():
        return text
    return "".join(each if each in _KEPT or each.isprintable() else ascii(each)[1:-1] for each in text)


def _safe(stream: io.TextIOWrapper) -> SafeStream:
    # the old one stays alive as sys.__stdout__, so that the file below them is not closed
    safe = SafeStream(
        cast("io.BufferedWriter", stream.buffer),
        encoding=stream.encoding,
        errors=REPLACING,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
    stream.flush()
    return safe


def _occupied(number: int) -> int:
    """Return a file descriptor that leads nowhere, put where one is closed: else the next file would be written to."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if nowhere != number:
        os.dup2(nowhere, number)
        os.close(nowhere)
    return number

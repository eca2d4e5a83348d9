"""The fields of a serialised message, each checked as it is read."""

from __future__ import annotations

import struct

from garment_dataset.errors import MessageError

_MOST_TEXT_BYTES = 256  # frame ids and encodings are names; what is longer is damage


class Fields:
    """The fields of a serialised message, read one after the other and never beyond its end.

    A MessageError says what is missing, or cannot be.
    """

    def __init__(self, data: memoryview, *, cdr: bool) -> None:
        self.position = 0
        self._data = data
        self._cdr = cdr
        self._uint32 = struct.Struct("<I")
        if cdr:
            if (encapsulation := bytes(data[:2])) not in {b"\0\0", b"\0\1"}:
                raise MessageError("encapsulation", expected="plain CDR", found=encapsulation)
            self._uint32 = struct.Struct("<I" if encapsulation[1] else ">I")
            self.position = 4  # what CDR aligns to; a multiple of 4 itself

    def uint8(self, name: str) -> int:
        """Return a byte."""
        self._need(name, 1)
        self.position += 1
        return self._data[self.position - 1]

    def uint32(self, name: str) -> int:
        """Return an unsigned integer of 4 bytes."""
        if self._cdr:
            self.position += -self.position % 4
        self._need(name, 4)
        self.position += 4
        value: int = self._uint32.unpack_from(self._data, self.position - 4)[0]
        return value

    def length(self, name: str) -> int:
        """Return the same, where it counts pixels or bytes."""
        if (value := self.uint32(name)) >= 2**31:
            raise MessageError(name, expected="less than 2**31", found=value)
        return value

    def sequence(self, name: str) -> tuple[int, int]:
        """Return where the bytes of a string or an array start, and how many there are."""
        size = self.uint32(name)
        self._need(name, size)
        self.position += size
        return self.position - size, size

    def view(self, start: int, size: int) -> memoryview:
        """Return a part of the message."""
        return self._data[start : start + size]

    def text(self, name: str) -> str:
        """Return a string that is a name."""
        raw = bytes(self.view(*self.sequence(name)))
        text = (raw.removesuffix(b"\0") if self._cdr else raw).decode(errors="replace")
        if len(raw) > _MOST_TEXT_BYTES or "\N{REPLACEMENT CHARACTER}" in text or not text.isprintable():
            raise MessageError(name, expected=f"printable text of at most {_MOST_TEXT_BYTES} bytes", found=raw[:32])
        return text

    def stamp_ns(self) -> int:
        """Return the stamp of a header, in nanoseconds."""
        if not self._cdr:
            self.uint32("seq")
        seconds, nanoseconds = self.uint32("stamp"), self.uint32("stamp")
        if nanoseconds >= 10**9:
            raise MessageError("stamp", expected="less than 1e9 nanoseconds", found=nanoseconds)
        return seconds * 10**9 + nanoseconds

    def end(self) -> None:
        """Refuse a message that goes on."""
        padding = 3 if self._cdr else 0
        if len(self._data) - self.position > padding:
            raise MessageError("message", expected=f"{self.position} bytes", found=f"{len(self._data)} bytes")

    def _need(self, name: str, size: int) -> None:
        if (left := len(self._data) - self.position) < size:
            raise MessageError(name, expected=f"{size} bytes", found=f"{left} bytes before the end of the message")

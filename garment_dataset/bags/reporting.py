"""Whatever goes wrong with a recording, in one line."""

from __future__ import annotations

import errno
from contextlib import contextmanager
from typing import TYPE_CHECKING

from garment_dataset.bags.definitions import reason
from garment_dataset.errors import BagError, SourceError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

# Other numbers, such as that of a seek to a senseless place, and errors without one, come from the data
_OF_THE_MACHINE = {
    *(errno.EACCES, errno.EPERM, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE, errno.ENOSPC),
    *(errno.ENODEV, errno.ENXIO, errno.ESTALE, errno.ETIMEDOUT),
}


@contextmanager
def reporting(path: Path, what: str, hint: str) -> Iterator[None]:
    """Report whatever goes wrong with a recording in one line.

    Raises
    ------
    SourceError
        If the machine cannot read it: no permission, no memory, a failing disk. The recording may be sound.
    BagError
        If what was read cannot be understood.
    """
    try:
        yield
    except (BagError, SourceError):
        raise
    except Exception as error:  # rosbags lets through what its libraries raise, and asserts what damage breaks
        for each in (error, error.__cause__):
            if isinstance(each, MemoryError):
                raise SourceError("cannot be read", where=path, found="not enough memory") from error
            if isinstance(each, OSError) and each.errno in _OF_THE_MACHINE:
                raise SourceError("cannot be read", where=path, found=each.strerror) from error
        raise BagError(what, where=path, found=reason(error), hint=hint) from error

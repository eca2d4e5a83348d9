"""Results that nothing asks for any more, as findings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.catalog.lint import Finding

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from garment_dataset.workspace.session import Session


def orphaned_results(session: Session) -> Iterator[Finding]:
    """Yield whose results lie in the features folder and are asked for by nothing any more.

    Parameters
    ----------
    session : Session
        A workspace opened for planning.
    """
    files: dict[tuple[str, str], list[Path]] = {}
    for path, why in session.orphaned_files().items():
        files.setdefault((path.stem, why), []).append(path)
    for (subject, why), paths in files.items():
        message = f"{len(paths)} files of results that nothing asks for: {why}"
        hint = "`garment gc --delete` removes them; of a renamed bag, `garment build` moves them first."
        yield Finding("orphaned", "warning", subject, str(paths[0]), message, hint)

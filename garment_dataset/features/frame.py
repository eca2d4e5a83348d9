"""The DataFrame that a table is read into: one that shows the units of its columns in a notebook."""

from __future__ import annotations

import pandas as pd

_MOST_ROWS = 20


class FeatureFrame(pd.DataFrame):
    """A DataFrame like any other; what is made of it is a plain one."""

    def _repr_html_(self) -> str | None:
        """Return the first and last rows as HTML, units below the names of the columns, and how many rows there are."""
        if not pd.get_option("display.notebook_repr_html"):
            return None
        units = self.attrs.get("units", {})
        shown = pd.DataFrame(self)
        if self.columns.nlevels == 1:
            texts = [f"[{units[name]}]" if name in units else "" for name in self.columns]
            shown.columns = pd.MultiIndex.from_arrays([self.columns, texts])
        columns = pd.get_option("display.max_columns")
        return shown.to_html(max_rows=_MOST_ROWS, max_cols=columns, show_dimensions=True, notebook=True)

"""How results show themselves: a line in a shell, a table in a notebook, a data frame if asked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from leaderboard.pages.markup import Content, Markup, element


class Shown(ABC):
    """Something with a title and a table of rows."""

    @property
    @abstractmethod
    def title(self) -> str:
        """What it is, in a line."""

    @abstractmethod
    def rows(self) -> list[dict[str, Any]]:
        """Its table: a dictionary for each row, all with the same names."""

    def to_dataframe(self) -> Any:
        """Its table as a data frame of pandas.

        Raises:
            ImportError: If there is no pandas.
        """
        try:
            import pandas
        except ImportError as error:
            raise ImportError(
                "to_dataframe() needs pandas: pip install pandas; rows() has the same without it"
            ) from error
        return pandas.DataFrame(self.rows())

    def __repr__(self) -> str:
        return f"<{self.title}>"

    def _repr_html_(self) -> str:
        rows = self.rows()
        head = element("tr", *(element("th", name) for name in (rows[0] if rows else ())))
        body = [element("tr", *map(_cell, row.values())) for row in rows]
        table = element("table", element("thead", head), element("tbody", *body))
        return element("div", element("p", self.title), table if rows else "", self._beside())

    def _beside(self) -> Content:
        """What a notebook shows below the table."""
        return ""


def _cell(value: Any) -> Markup:
    if isinstance(value, float):
        return element("td", f"{value:.2f}")
    return element("td", "" if value is None else str(value))

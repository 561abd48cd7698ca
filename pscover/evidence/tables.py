"""Tables as values: made once, shown on a terminal, in Markdown, in CSV and in a page."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass

from pscover.errors import InvalidResult
from pscover.experiment.statistics import Interval

NOTHING = "–"


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Rows of text under named columns.

    Parameters
    ----------
    name
        Short, of letters, digits and hyphens: of files and of anchors.
    title
        What it shows.
    columns, rows
        Names, and a text for each of them in each row.
    text_columns
        Those that hold words; all others hold numbers, with signs and intervals around them.
    filters
        Columns by whose values a reader may want to choose rows.
    notes
        How it was made and what limits it: a sentence or two each.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: frozenset[str] = frozenset()
    filters: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for k, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise InvalidResult(f"table {self.name}, row {k}: expected {len(self.columns)} cells, got {len(row)}")

    def markdown(self) -> str:
        r"""As Markdown, without title and notes.

        Examples
        --------
        >>> print(Table(name="t", title="T", columns=("who", "s"), rows=(("a|b", "1"),), text_columns={"who"}).markdown())
        | who | s |
        |---|---:|
        | a\|b | 1 |
        """
        rule = "".join("---|" if name in self.text_columns else "---:|" for name in self.columns)
        lines = [self.columns, *self.rows]
        head, *body = ["| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines]
        return "\n".join([head, f"|{rule}", *body])

    def csv(self) -> str:
        """As comma-separated values.

        Examples
        --------
        >>> Table(name="t", title="T", columns=("who", "s"), rows=(("a,b", "1"),)).csv().splitlines()
        ['who,s', '"a,b",1']
        """
        out = io.StringIO()
        csv.writer(out, lineterminator="\n").writerows([self.columns, *self.rows])
        return out.getvalue()


def number(value: float | None) -> str:
    """Three digits; a dash for what is not there.

    Examples
    --------
    >>> number(0.12345), number(12345.6), number(None), number(19.66)
    ('0.123', '12 346', '–', '19.7')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if abs(value) >= 1000:
        return f"{value:,.0f}".replace(",", " ")
    return f"{value:.3g}"


def interval(value: Interval, count: int) -> str:
    """A mean, and its interval where it comes from more than one value.

    Examples
    --------
    >>> interval(Interval(mean=2.0, low=1.5, high=2.25), 5), interval(Interval(mean=2.0, low=2.0, high=2.0), 1)
    ('2 (1.5–2.25)', '2')
    """
    if count < 2 or value.low == value.high:
        return number(value.mean)
    dash = " to " if value.low < 0 else "–"
    return f"{number(value.mean)} ({number(value.low)}{dash}{number(value.high)})"

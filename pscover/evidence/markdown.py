"""The Markdown in which results are kept: headings, paragraphs, lists and pipe tables, read into values."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from pscover.evidence.tables import Table

CELL = re.compile(r"(?<!\\)\|")
RULE = re.compile(r"^\|?\s*:?-{2,}:?\s*(\|\s*:?-{2,}:?\s*)*\|?$")
FILTERS = (
    "family",
    "instance",
    "backend",
    "formulation",
    "engine",
    "segmenter",
    "policy",
    "peer",
    "layout",
    "stage",
    "status",
)
MOST_VALUES = 30
POINT = re.compile(r"^[-*] ")
IMAGE = re.compile(r"^!\[[^\]]*\]\([^)]*\)$")
NUMERIC = re.compile(r"^(–|-|>|<|≥|≤|±|×|✓|%|s|\d|[.,:/()\[\] ]|e[+-]?\d|none|left out|to|of|cut off)*$")


@dataclass(frozen=True, slots=True)
class Heading:
    """A line above what follows."""

    text: str


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A text with `code`, **bold** and [links](https://...)."""

    text: str


@dataclass(frozen=True, slots=True)
class Points:
    """A list, each of its points a text."""

    texts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Code:
    """Lines that are shown as they are."""

    text: str


Block = Heading | Paragraph | Points | Code | Table


def blocks(text: str, name: str, title: str) -> list[Block]:
    """What a page in Markdown holds; a table's title is the heading above it, pictures are left out.

    Parameters
    ----------
    text
        The page.
    name
        For its tables, which get a number.
    title
        For tables above which there is no heading.

    Examples
    --------
    >>> found = blocks("# Times\\n\\nOf all.\\n\\n| who | s |\\n|---|---|\\n| me | 1.5 |\\n", "times", "")
    >>> [type(block).__name__ for block in found], found[2].title, found[2].rows
    (['Heading', 'Paragraph', 'Table'], 'Times', (('me', '1.5'),))
    """
    found: list[Block] = []
    above = title
    for group in _groups(text.splitlines()):
        first = group[0]
        if first.startswith("```"):
            found.append(Code("\n".join(group[1:])))
        elif all(line.startswith("    ") for line in group):
            found.append(Code("\n".join(line[4:] for line in group)))
        elif POINT.match(first):
            found.append(Points(tuple(_points(group))))
        elif first.startswith("#"):
            above = first.lstrip("# ")
            found.append(Heading(above))
        elif len(group) > 1 and "|" in first and RULE.match(group[1].strip()):
            number = 1 + sum(isinstance(block, Table) for block in found)
            found.append(_table(group, f"{name}-{number}", above))
        elif not IMAGE.match(first):
            found.append(Paragraph(" ".join(line.strip() for line in group)))
    return found


def _groups(lines: Sequence[str]) -> Iterator[list[str]]:
    """Lines that belong together: a fence, a heading, or what stands between empty lines."""
    group: list[str] = []
    is_fenced = False
    for line in [*lines, ""]:
        is_mark = line.startswith("```")
        if is_fenced and not is_mark:
            group.append(line)
        elif is_fenced or not line.strip():
            is_fenced = False
            if group:
                yield group
            group = []
        elif is_mark or line.startswith("#"):
            if group:
                yield group
            group, is_fenced = ([line], True) if is_mark else ([], False)
            if not is_mark:
                yield [line]
        else:
            group.append(line)
    if group:
        yield group


def _points(lines: Sequence[str]) -> list[str]:
    points: list[str] = []
    for line in lines:
        if POINT.match(line):
            points.append(line[2:].strip())
        else:
            points[-1] += " " + line.strip()
    return points


def _table(lines: Sequence[str], name: str, title: str) -> Table:
    head, *body = [_cells(line) for line in (lines[0], *lines[2:])]
    rows = tuple(tuple((*row, *[""] * len(head))[: len(head)]) for row in body)
    return worded(Table(name=name, title=title, columns=tuple(head), rows=rows))


def _cells(line: str) -> list[str]:
    inner = line.strip().removeprefix("|")
    inner = inner[:-1] if inner.endswith("|") and not inner.endswith("\\|") else inner
    return [cell.strip().replace("\\|", "|") for cell in CELL.split(inner)]


def untitled(found: Sequence[Block], title: str) -> list[Block]:
    """The same, where a table does not repeat the heading above it, or the title above all.

    Examples
    --------
    >>> table = Table(name="t", title="Times", columns=("s",), rows=())
    >>> [block.title for block in untitled([table, Heading("Times"), table], "All") if isinstance(block, Table)]
    ['Times', '']
    """
    above, out = title, list[Block]()
    for block in found:
        if isinstance(block, Heading):
            above = block.text
        out.append(replace(block, title="") if isinstance(block, Table) and block.title == above else block)
    return out


def worded(table: Table) -> Table:
    """The same, with the columns that hold words found out, and with filters for those of them that say what was run.

    Examples
    --------
    >>> found = worded(Table(name="t", title="T", columns=("backend", "s"), rows=(("a", "1"), ("b", "> 2"))))
    >>> sorted(found.text_columns), found.filters
    (['backend'], ('backend',))
    """
    words, filters = set(), []
    for k, column in enumerate(table.columns):
        values = {row[k].replace("*", "") for row in table.rows}
        if not all(NUMERIC.match(value) for value in values):
            words.add(column)
        if column.lower() in FILTERS and 1 < len(values) <= MOST_VALUES:
            filters.append(column)
    return replace(table, text_columns=frozenset(words), filters=tuple(filters))

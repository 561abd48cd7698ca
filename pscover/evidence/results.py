"""Folders of results, read into sections of a page: words, tables, pictures, and the raw data to take away."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pscover.errors import InvalidResult, PscoverError
from pscover.evidence.cases import case_table
from pscover.evidence.markdown import Block, Heading, Paragraph, Points, blocks, untitled, worded
from pscover.evidence.sweep import RESULTS
from pscover.evidence.tables import NOTHING, Table, number
from pscover.files import read_bytes

KNOWN = {
    "table2": ("Time against garments: the paper's Table 2", "pscover bench table2 -o FOLDER/table2"),
    "groups": ("Time against groups: the paper's third experiment", "pscover bench groups -o FOLDER/groups"),
    "table1": ("Objects per transport: the paper's Table 1", "pscover simulate --policy all -o FOLDER/table1"),
    "study": ("Formulations against each other", "pscover bench study -o FOLDER/study"),
    "exact": ("Proven plans at the paper's sizes", "pytest bench/bench_exact.py --tables FOLDER/exact"),
    "piles": ("Dense piles, against other engines", "python bench/peers/contest.py piles --run ..."),
    "covers": ("OR-Library set cover, against other engines", "python bench/peers/contest.py covers --run ..."),
    "probabilistic": (
        "Probabilistic set cover on OR-Library, against other engines",
        "python bench/peers/contest.py probabilistic --run ...",
    ),
    "scale": ("Large instances", "pytest bench/bench_scale.py"),
}
"""Sections by name, in the order of the page: their titles, and what makes them."""
BYTE_LIMIT = 2**24
"""Files above 16 MiB are named, but neither read nor put into a page."""
PICTURES = {".svg": "image/svg+xml", ".png": "image/png"}
RAW = {".json": "application/json", ".jsonl": "application/x-ndjson", ".csv": "text/csv"}
OF_A_SECTION = ("sweep.json", "experiment.json", "machine.json", "README.md")
"""A folder that holds one of these is a section by itself; others hold sections."""


@dataclass(frozen=True, slots=True, kw_only=True)
class File:
    """A file as a page carries it along.

    Parameters
    ----------
    name
        With its folder within the section.
    media
        Its media type.
    content
        All of it.
    """

    name: str
    media: str
    content: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """What is known of one experiment.

    Parameters
    ----------
    name, title
        Short, and in words.
    blocks
        Words and tables, in the order in which they are read.
    pictures, raw
        Files to look at, and to take away.
    left_out
        Names of files that are too large.
    """

    name: str
    title: str
    blocks: tuple[Block, ...]
    pictures: tuple[File, ...] = ()
    raw: tuple[File, ...] = ()
    left_out: tuple[str, ...] = ()


def sections(folders: Sequence[Path]) -> list[Section]:
    """All that the folders hold, those known first, each once: where two have the same name, the first.

    Raises
    ------
    InvalidResult
        If a folder is none, or a file in it cannot be read.
    """
    found: dict[str, Section] = {}
    for folder in folders:
        if not folder.is_dir():
            raise InvalidResult(f"{folder}: expected a folder of results, got {'a file' if folder.exists() else 'nothing'}")
        for name, paths in _of(folder).items():
            found.setdefault(name, _section(name, folder, paths))
    order = [*KNOWN, *sorted(found)]
    kept = [found[name] for name in dict.fromkeys(order) if name in found]
    return [section for section in kept if section.blocks or section.raw]


def missing(found: Iterable[Section]) -> list[str]:
    """Names of known sections that are not there."""
    present = {section.name for section in found}
    return [name for name in KNOWN if name not in present]


def _of(folder: Path) -> dict[str, list[Path]]:
    """Files of each section."""
    try:
        entries = sorted(folder.iterdir())
    except OSError as problem:
        raise InvalidResult(f"{folder}: cannot be read: {problem.strerror}") from None
    if any((folder / name).is_file() for name in OF_A_SECTION) or folder.name in KNOWN:
        return {folder.resolve().name: _files(folder)}
    named: dict[str, list[Path]] = {}
    for entry in entries:
        if entry.is_dir():
            named[entry.name] = _files(entry)
        elif entry.suffix in {*PICTURES, *RAW, ".md"}:
            named.setdefault(entry.stem, []).append(entry)
    return named


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))


def _section(name: str, folder: Path, paths: Sequence[Path]) -> Section:
    small = [path for path in paths if path.stat().st_size <= BYTE_LIMIT]
    words: list[Block] = []
    for path in small:
        if path.suffix == ".md":
            text = _read(path).decode("utf-8", "replace")
            words += blocks(text, f"{name}-{path.stem.lower()}", KNOWN.get(name, (name, ""))[0])
    if not any(isinstance(block, Table) for block in words):
        words += [_csv_table(path) for path in small if path.suffix == ".csv"]
    words += [table for path in small if path.suffix == ".json" and (table := _runs(name, path)) is not None]
    words += [table for path in small if path.name == RESULTS and (table := case_table(path.parent)) is not None]
    title = KNOWN[name][0] if name in KNOWN else name
    return Section(
        name=name,
        title=title,
        blocks=tuple(_without_title(words)),
        pictures=tuple(_file(path, folder, PICTURES) for path in _one_each(small)),
        raw=tuple(_file(path, folder, RAW) for path in small if path.suffix in RAW),
        left_out=tuple(str(path.relative_to(folder)) for path in paths if path not in small),
    )


def _without_title(words: Sequence[Block]) -> list[Block]:
    """Without a heading that opens the page: the section has one."""
    return list(words[1:] if words and isinstance(words[0], Heading) and len(words) > 1 else words)


def _one_each(paths: Sequence[Path]) -> list[Path]:
    """Pictures; of those that come as SVG and as PNG, the SVG."""
    drawn = [path for path in paths if path.suffix in PICTURES]
    return [path for path in drawn if path.suffix == ".svg" or path.with_suffix(".svg") not in drawn]


def _file(path: Path, folder: Path, media: dict[str, str]) -> File:
    return File(name=path.relative_to(folder).as_posix(), media=media[path.suffix], content=_read(path))


def _read(path: Path) -> bytes:
    return read_bytes(path, BYTE_LIMIT, InvalidResult)


def _csv_table(path: Path) -> Table:
    try:
        rows = list(csv.reader(io.StringIO(_read(path).decode("utf-8", "replace"))))
    except csv.Error as problem:
        raise InvalidResult(f"{path}: expected comma-separated values, got something else ({problem})") from None
    head, *body = rows or [[]]
    for k, row in enumerate(body, start=2):
        if len(row) != len(head):
            raise InvalidResult(f"{path}, line {k}: expected {len(head)} values, got {len(row)}")
    shown = tuple(tuple(_short(cell) for cell in row) for row in body)
    title = path.stem.replace("_", " ")
    return worded(Table(name=path.stem.lower(), title=title, columns=tuple(head), rows=shown))


def _short(cell: str) -> str:
    """A number with three digits; whole ones, and all else, as they are."""
    try:
        value = float(cell)
    except ValueError:
        return cell
    return cell if value.is_integer() and "e" not in cell.lower() and "." not in cell else number(value)


def _runs(name: str, path: Path) -> Table | None:
    """A row for each run of a contest; None if the file is something else."""
    try:
        document = json.loads(_read(path))
    except ValueError as problem:
        raise InvalidResult(f"{path}: expected JSON, got something else ({problem})") from None
    runs = document.get("runs") if isinstance(document, dict) else None
    if not isinstance(runs, dict) or document.get("schema") != "pscover.bench/1":
        return None
    columns = ("family", "instance", "backend", "formulation", "limit s", "plan", "bound", "gap %", "CPU s", "status", "MiB")
    try:
        rows = tuple(_run(name, run) for _, run in sorted(runs.items()))
    except (KeyError, TypeError, AttributeError) as problem:
        raise InvalidResult(f"{path}: expected runs of a contest, got something else ({problem!r})") from None
    return worded(Table(name=f"{name}-runs", title="Every run", columns=columns, rows=rows))


def _run(family: str, run: dict[str, Any]) -> tuple[str, ...]:
    plan, bound = run["objective"], run["bound"]
    gap = 100 * (plan - bound) / plan if plan and bound is not None and math.isfinite(plan) else None
    formulation = "set cover" if run["contestant"] in ("cft", "ortools_cover") else "clique"
    return (
        *(family, str(run["instance"]), str(run["contestant"]), formulation, number(run["limit"])),
        *(number(plan), number(bound), number(gap), number(run["seconds"])),
        *(str(run["status"] or NOTHING).splitlines()[-1][:40], number(run.get("peak_mib"))),
    )


def markdown(found: Sequence[Section]) -> str:
    """The same words and numbers, for a page in Markdown.

    Examples
    --------
    >>> section = Section(name="x", title="Times", blocks=(Paragraph("Of all."),))
    >>> markdown([section]).split("\\n\\n")[:3]
    ['# Results', '## Times', 'Of all.']
    """
    parts = ["# Results"]
    for section in found:
        parts.append(f"## {section.title}")
        parts += [_text(block) for block in untitled(section.blocks, section.title)]
    gone = missing(found)
    if gone:
        parts.append(f"Not measured yet: {', '.join(gone)}.")
    return "\n\n".join(part for part in parts if part) + "\n"


def _text(block: Block) -> str:
    match block:
        case Heading():
            return f"### {block.text}"
        case Paragraph():
            return block.text
        case Points():
            return "\n".join(f"- {text}" for text in block.texts)
        case Table():
            return "\n\n".join([*([f"**{block.title}**"] if block.title else []), block.markdown(), *block.notes])
        case _:
            return f"```\n{block.text}\n```"


def require(found: Sequence[Section], folders: Sequence[Path]) -> None:
    """Raise unless there is something to show."""
    if not found:
        names = ", ".join(map(str, folders))
        raise PscoverError(f"{names}: expected results of pscover's benchmarks, got none; run `pscover bench table2` first")

"""A folder of any sweep as one table: a row for each case, or for each of the runs that its timing lists."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec

from pscover.errors import InvalidResult
from pscover.evidence.markdown import worded
from pscover.evidence.sweep import RESULTS, TIMINGS
from pscover.evidence.tables import Table, number
from pscover.files import TEXT_LIMIT, read_bytes

MOST_ROWS = 3000
"""Longer tables are cut: the raw data hold all."""
UNSHOWN = ("digest", "chosen", "file", "engines")
KEPT = ("family", "backend", "formulation", "segmenter")
"""Columns that are shown even if there is but one value in them."""


def case_table(folder: Path) -> Table | None:
    """All cases of a sweep, with what is a number or a word of their rows and timings; None if there are none.

    Raises
    ------
    InvalidResult
        If a file is none of a sweep.
    """
    timings = {
        msgspec.json.encode(line.get("case"), order="sorted"): line.get("timing") for line in _lines(folder / TIMINGS)
    }
    records: list[dict[str, Any]] = []
    for line in _lines(folder / RESULTS):
        records += _records([line.get("case"), line.get("row"), timings.get(_key(line))])
    if not records:
        return None
    columns = tuple(dict.fromkeys(name for record in records for name in record))
    shown = records[:MOST_ROWS]
    rows = tuple(tuple(_text(record.get(name)) for name in columns) for record in shown)
    varying = [k for k, name in enumerate(columns) if len(columns) < 4 or len({row[k] for row in rows}) > 1 or name in KEPT]
    cut = (f"The first {MOST_ROWS} of {len(records)} rows; the raw data hold all.",) if len(shown) < len(records) else ()
    return worded(
        Table(
            name=f"{folder.name}-cases",
            title=f"Every case of {folder.name}",
            columns=tuple(columns[k] for k in varying),
            rows=tuple(tuple(row[k] for k in varying) for row in rows),
            notes=cut,
        )
    )


def _records(parts: list[Any]) -> Iterator[dict[str, Any]]:
    """One for each element of the list of runs that a part holds; one if there is no list."""
    record: dict[str, Any] = {}
    runs: list[dict[str, Any]] = []
    for part in parts:
        for name, value in _flat(part):
            if isinstance(value, list):
                runs += [item for item in value if isinstance(item, dict)]
            else:
                # A stage is timed under the name of what it makes.
                record[f"{name}, seconds" if name in record else name] = value
    for run in runs or [{}]:
        flat = record | dict(_flat(run))
        yield _engine(flat.pop("engine", None)) | flat


def _engine(text: Any) -> dict[str, str]:
    """Backend and formulation of an engine, by which one can choose rows."""
    if not isinstance(text, str):
        return {}
    backend, _, formulation = text.partition("/")
    return {"backend": backend, "formulation": formulation}


def _flat(part: Any) -> Iterator[tuple[str, Any]]:
    if not isinstance(part, Mapping):
        return
    for name, value in part.items():
        if isinstance(value, Mapping):
            yield from _flat(value)
        elif name not in UNSHOWN:
            yield name, value


def _key(line: Mapping[str, Any]) -> bytes:
    return msgspec.json.encode(line.get("case"), order="sorted")


def _lines(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    content = read_bytes(path, TEXT_LIMIT, InvalidResult)
    try:
        return [msgspec.json.decode(line, type=dict[str, Any]) for line in content.splitlines()]
    except msgspec.DecodeError as problem:
        raise InvalidResult(f"{path}: expected a line a case, got something else ({problem})") from None


def _text(value: Any) -> str:
    match value:
        case None:
            return "–"
        case bool():
            return "yes" if value else "no"
        case int():
            return str(value)
        case float():
            return number(value)
        case _:
            return str(value)

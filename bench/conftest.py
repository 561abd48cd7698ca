"""What the benchmarks share: where real data lie, and the tables printed at the end of a run."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from pscover.evidence.machine import this_machine

sys.path.append(str(Path(__file__).parents[1]))
SHARED = Path(__file__).parents[2] / "shared"
# Programs of their own, not benchmark cases.
collect_ignore_glob = ["fuzz_*.py", "*_table.py", "mujoco_*.py", "compare.py", "peers/*"]

_tables: dict[str, list[dict[str, Any]]] = {}
Row = Callable[..., None]


@pytest.fixture
def orlib() -> Path:
    """The folder of OR-Library files beside the repository."""
    folder = SHARED / "orlib"
    if not folder.is_dir():
        pytest.skip("OR-Library files are not shipped: put them into ../shared/orlib")
    return folder


@pytest.fixture
def row() -> Row:
    """Add one row to the table of that title, printed when the run ends."""

    def add(title: str, **columns: Any) -> None:
        _tables.setdefault(title, []).append(columns)

    return add


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--tables", metavar="FOLDER", help="also write every table as CSV, with the machine in machine.json")


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    for title, rows in _tables.items():
        names = list(dict.fromkeys(name for one in rows for name in one))
        cells = [[_text(one.get(name, "")) for name in names] for one in rows]
        widths = [max(len(line[k]) for line in [names, *cells]) for k in range(len(names))]
        terminalreporter.section(title)
        for line in [names, *cells]:
            terminalreporter.write_line("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))
    folder = config.getoption("--tables")
    if folder and _tables:
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        for title, rows in _tables.items():
            names = list(dict.fromkeys(name for one in rows for name in one))
            with (target / f"{title.split(':')[0].replace(' ', '_')}.csv").open("w", newline="") as file:
                writer = csv.DictWriter(file, names)
                writer.writeheader()
                writer.writerows(rows)
        (target / "machine.json").write_bytes(msgspec.json.format(msgspec.json.encode(this_machine()), indent=2) + b"\n")


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)

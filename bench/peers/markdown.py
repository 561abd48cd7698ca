"""Tables of results as Markdown, written whole."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from pscover.files import write_bytes

CLOCK = (
    "The clock of every contestant is CPU seconds of its process and of its workers, read at each plan and bound it tells, "
    "and so is its limit: other work on the machine changes little. One thread each, a process of its own each, the same "
    "instance; every plan was checked against the instance (requirements to 1e-6, conflicts exactly). Loading an engine and "
    "handing the model over is not on a peer's clock; building the model is on ours."
)


def table(rows: list[dict[str, Any]]) -> str:
    """Rows as a Markdown table; columns in the order of their first appearance."""
    if not rows:
        return "Nothing measured yet.\n"
    names = list(dict.fromkeys(name for row in rows for name in row))
    lines = [names, ["---"] * len(names), *([cell(row.get(name, "")) for name in names] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def cell(value: Any) -> str:
    """A figure to three or four digits, a dash for none."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if isinstance(value, float):
        return f"{value:.0f}" if value == round(value) and abs(value) >= 1 else f"{value:.3g}"
    return str(value)


def plan_text(run: dict[str, Any] | None) -> str:
    """`plan [bound]`, with a tick where they meet; a dash without a run."""
    if run is None:
        return "–"
    plan, bound = run["objective"], run["bound"]
    if plan is None and bound is not None and run["status"] == "infeasible":
        return "infeasible"
    text = f"{'none' if plan is None else f'{plan:g}'} [{'none' if bound is None else f'{bound:g}'}]"
    return text + (" ✓" if plan is not None and bound is not None and bound >= plan - 1e-9 else "")


def provenance(runs: list[dict[str, Any]]) -> str:
    """Versions, machine, commits and dates of the runs of a table."""
    versions: dict[str, set[str]] = {}
    for run in runs:
        for name, version in run["versions"].items():
            versions.setdefault(name, set()).add(version)
    machines = sorted({_machine(run["machine"]) for run in runs})
    packages = ", ".join(f"{name} {'/'.join(sorted(found))}" for name, found in sorted(versions.items()))
    days = sorted(run["when"] for run in runs)
    trees = ", ".join(sorted({run["commit"] for run in runs if run["contestant"].startswith("auto")}))
    return f"{packages}; {'; '.join(machines)}; {days[0]} to {days[-1]}; our tree: {trees or '–'}; seed 0.\n"


def _machine(record: dict[str, Any]) -> str:
    # Older runs have the number of processors in front of the name.
    many = f"{record['cores']} x " if "cores" in record else ""
    return f"{many}{record['processor']}, Python {record['python']}"


def write(path: Path, title: str, parts: list[str]) -> None:
    """The page, atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, ("\n\n".join([f"# {title}", *(part.strip() for part in parts)]) + "\n").encode())

"""The results of an experiment as files: CSV, Markdown, and Parquet where pyarrow is installed."""

from __future__ import annotations

import csv
import importlib.util
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pscover.experiment.published import TABLE_1
from pscover.experiment.statistics import Interval, Row
from pscover.experiment.store import Store
from pscover.experiment.trial import Outcome
from pscover.files import write_bytes

NARROW = ("policy", "clear", "OpT", "95 %", "paper", "× random", "PPH", "paper ", "trips")
"""The columns that a terminal of 80 characters has room for."""


def write_results(store: Store, outcomes: Sequence[Outcome], rows: Sequence[Row]) -> list[Path]:
    """Write all tables into the experiment's folder: the same bytes for the same outcomes; only `timing.*` has wall time.

    Returns
    -------
    list[Path]
        What was written.
    """
    episodes = [_episode(outcome) for outcome in outcomes]
    timing = [_timing(store, outcome) for outcome in outcomes]
    written = []
    for name, records in (("episodes", episodes), ("summary", [_flat(row) for row in rows]), ("timing", timing)):
        written.append(store.folder / f"{name}.csv")
        write_bytes(written[-1], _csv(records))
    written.append(store.folder / "summary.md")
    write_bytes(written[-1], markdown(rows).encode())
    if importlib.util.find_spec("pyarrow") is not None:
        written.append(store.folder / "episodes.parquet")
        write_bytes(written[-1], _parquet(episodes))
    return written


def cells(row: Row) -> dict[str, str]:
    """A policy's row as text, by column."""
    paper = TABLE_1.get(row.policy)
    return {
        "policy": row.policy,
        "clear": f"{row.cleared}/{row.episodes}",
        "OpT": _number(row.opt.mean),
        "95 %": _range(row.opt),
        "paper": f"{paper.opt:.2f}±{paper.bound:.2f}" if paper else "–",
        "OpT without empty": _number(row.opt_without_empty.mean),
        "× random": _number(row.gain.mean),
        "95 % ": _range(row.gain),
        "PPH": _number(row.pph.mean, 0),
        "paper ": f"{paper.pph:.0f}" if paper and paper.pph else "–",
        "trips": _number(row.trips, 1),
        "empty": _number(row.empty, 1),
        "stood in": _number(row.stand_ins, 1),
        "rearranged": _number(row.places, 1),
        "fell off": _number(row.fallen, 1),
        "left": _number(row.left, 1),
    }


def markdown(rows: Sequence[Row]) -> str:
    """The table in Markdown."""
    found = [cells(row) for row in rows]
    heads = list(found[0]) if found else ["policy"]
    lines = [heads, ["---"] + ["---:"] * (len(heads) - 1), *(list(row.values()) for row in found)]
    return "\n".join(f"| {' | '.join(map(str.strip, line))} |" for line in lines) + "\n"


def _number(value: float, digits: int = 2) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


def _range(interval: Interval) -> str:
    if math.isnan(interval.mean):
        return "–"
    return f"{interval.low:.2f}–{interval.high:.2f}"


def _episode(outcome: Outcome) -> dict[str, Any]:
    return {
        "policy": outcome.policy,
        "seed": outcome.seed,
        "reason": outcome.reason,
        "garments": outcome.garments,
        "removed": outcome.removed,
        "trips": outcome.trips,
        "empty": outcome.empty,
        "stand_ins": outcome.stand_ins,
        "picks": outcome.picks,
        "rearrangements": outcome.places,
        "failures": outcome.failures,
        "fallen": outcome.fallen,
        "left": outcome.left,
        "opt": outcome.opt,
        "opt_without_empty": outcome.opt_without_empty,
        "robot_seconds": outcome.seconds,
    }


def _timing(store: Store, outcome: Outcome) -> dict[str, Any]:
    timing = store.timing(outcome.policy, outcome.seed)
    deciding = math.nan if timing is None else timing.deciding
    seconds = outcome.seconds + deciding
    return {
        "policy": outcome.policy,
        "seed": outcome.seed,
        "deciding_seconds": deciding,
        "wall_seconds": math.nan if timing is None else timing.total,
        "pph_with_computing": 3600 * outcome.removed / seconds if seconds else math.nan,
    }


def _flat(row: Row) -> dict[str, Any]:
    paper = TABLE_1.get(row.policy)
    intervals = {"opt": row.opt, "opt_without_empty": row.opt_without_empty, "gain": row.gain, "pph_robot": row.pph}
    return {
        "policy": row.policy,
        "episodes": row.episodes,
        "cleared": row.cleared,
        **{
            f"{name}{end}": value
            for name, i in intervals.items()
            for end, value in (("", i.mean), ("_low", i.low), ("_high", i.high))
        },
        "trips": row.trips,
        "empty": row.empty,
        "stand_ins": row.stand_ins,
        "rearrangements": row.places,
        "fallen": row.fallen,
        "left": row.left,
        "paper_opt": paper.opt if paper else math.nan,
        "paper_bound": paper.bound if paper else math.nan,
        "paper_pph": paper.pph if paper and paper.pph else math.nan,
    }


def _csv(records: Sequence[dict[str, Any]]) -> bytes:
    text = io.StringIO()
    if records:
        writer = csv.DictWriter(text, fieldnames=list(records[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: _plain(value) for name, value in record.items()} for record in records)
    return text.getvalue().encode()


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return value


def _parquet(records: Sequence[dict[str, Any]]) -> bytes:
    import pyarrow
    import pyarrow.parquet

    content = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(list(records)), content)
    return content.getvalue()

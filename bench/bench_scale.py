"""From 100 to 1000 garments on a floor of up to 5 m x 6 m: plan, bound and gap after 10 CPU seconds, memory, growth.

    pytest bench/bench_scale.py

The floor grows with the garments: 2 350 x 2 820 pixels (4.7 a centimetre) hold 1000. Two layouts, 20 points a part:
garments apart with q = 0.7, and in groups of five that all overlap with q = 0.6. With the paper's 5 points a part five of
1000 garments apart cannot be reached with 0.7, and no plan exists; neither does one for 400 garments in groups with 0.7.
Results go to `bench/results/scale.json`, and `scale.md` and `scale.png` are drawn from them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.peers import markdown
from bench.peers.families import Case
from bench.peers.measures import at, first_within, relative_gap
from bench.peers.runner import Contestant, measure
from bench.peers.store import RESULTS, Store, sweep
from pscover.generate.garments import garments
from pscover.grasping.candidates import candidates
from pscover.grasping.sampling import Sampling
from pscover.instance import Instance

SIZES = (100, 200, 400, 700, 1000)
FLOOR = (2350, 2820)
GROUP = 5
REQUIRED = {"apart": 0.7, "groups": 0.6}
"""With 0.7 no plan of 400 garments in groups exists: each can be reached, but not all at once."""
LIMIT = 10.0
NEAR = 1.02
"""A plan this near to the final one counts as found, for the growth."""
MEMORY_MIB = 1500


def floor(count: int, layout: str, points: int = 20) -> Instance:
    """Garments on a floor whose area grows with them."""
    side = math.sqrt(count / SIZES[-1])
    size = (round(FLOOR[0] * side), round(FLOOR[1] * side))
    scene = garments(count, seed=0, size=size, groups=(GROUP,) * (count // GROUP) if layout == "groups" else ())
    return candidates(scene, sampling=Sampling(points=points), required=REQUIRED[layout])


def cases() -> list[Case]:
    """Both layouts, small to large."""
    return [
        Case(f"{layout}-{count}-q{REQUIRED[layout]:g}", _maker(count, layout))
        for count in SIZES
        for layout in ("apart", "groups")
    ]


def _maker(count: int, layout: str) -> Callable[[], Instance]:
    return lambda: floor(count, layout)


def exponent(size: list[float], cost: list[float]) -> float:
    """b of cost = a size^b, by least squares of the logarithms."""
    return float(np.polyfit(np.log(size), np.log(cost), 1)[0]) if len(size) > 1 else math.nan


def _of(known: list[tuple[float, float]]) -> float:
    return exponent([size for size, _ in known], [cost for _, cost in known])


def measured(rows: list[dict[str, Any]], column: str) -> list[tuple[float, float]]:
    """(candidates, figure) of the rows that have it; a run that was cut off did not end."""
    last = 0.99 * LIMIT if column.startswith("ended") else math.inf
    return [(row["candidates"], row[column]) for row in rows if 0 < row[column] < last]


def figures(run: dict[str, Any], instance: Instance) -> dict[str, Any]:
    """One row of the table."""
    objective, bound = at(run["trace"], run["limit"])
    return {
        "instance": run["instance"],
        "garments": instance.elements,
        "candidates": instance.candidates,
        "nonzeros": instance.probability.nnz,
        "plan": objective,
        "bound": bound,
        "gap": relative_gap(objective, bound),
        "first plan, s": first_within(run["trace"], math.inf),
        "within 2 % of the last plan, s": first_within(run["trace"], NEAR * objective),
        "ended, s": run["seconds"],
        "memory, MiB": run["peak_mib"],
    }


def page(store: Store, folder: Path) -> None:
    """The table and the plot."""
    runs = {run["instance"]: run for run in store.runs.values()}
    rows = [figures(runs[case.name], case.load()) for case in cases() if case.name in runs]
    growth = []
    for layout in ("apart", "groups"):
        mine = [row for row in rows if row["instance"].startswith(layout)]
        for column in ("first plan, s", "within 2 % of the last plan, s", "ended, s", "memory, MiB"):
            known = measured(mine, column)
            if len(known) > 1:
                growth.append(
                    {"layout": layout, "figure": column, "instances": len(known), "exponent in candidates": _of(known)}
                )
    markdown.write(
        folder / "scale.md",
        "Scale: garments on a floor",
        [
            markdown.CLOCK,
            f"`auto` for {LIMIT:g} s, 20 points a part; memory: all its processes, the instance included.",
            markdown.table(rows),
            "## Growth",
            markdown.table(growth),
            markdown.provenance(list(runs.values())),
        ],
    )
    plot(rows, folder / "scale.png")


def plot(rows: list[dict[str, Any]], path: Path) -> None:
    """CPU seconds against candidates, both logarithmic."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    marks = {"first plan, s": "o-", "within 2 % of the last plan, s": "s--", "ended, s": "^:"}
    for layout, colour in (("apart", "#1b6ca8"), ("groups", "#c1553b")):
        mine = [row for row in rows if row["instance"].startswith(layout)]
        for column, mark in marks.items():
            known = measured(mine, column)
            if len(known) < 2:
                continue
            size, cost = np.array(known).T
            label = f"{layout}: {column.removesuffix(', s')} (exponent {_of(known):.2f})"
            axes.plot(size, cost, mark, color=colour, label=label, linewidth=1.2, alpha=0.85)
    axes.axhline(LIMIT, color="grey", linestyle=":", linewidth=1)
    axes.set(xscale="log", yscale="log", xlabel="candidates", ylabel="CPU seconds")
    figure.legend(fontsize=8, loc="outside lower center", ncols=2)
    axes.grid(visible=True, which="both", linewidth=0.3)
    figure.savefig(path, dpi=130)


@pytest.mark.parametrize("layout", ["apart", "groups"])
def bench_scale(benchmark: Any, row: Any, tmp_path: Path, layout: str) -> None:
    if not benchmark.enabled:
        instance = benchmark.pedantic(floor, (10, layout, 2), rounds=1)
        if layout == "apart":
            assert instance.elements == 10
            return
        run = measure(f"{layout}-10", instance, Contestant(engine="auto", limit=0.5))
        found = figures(run.document(), instance)
        assert found["plan"] >= found["bound"] > 0
        row("Scale, smoke", **found)
        return
    store, wanted = Store(RESULTS / "scale.json"), [case for case in cases() if case.name.startswith(layout)]
    benchmark.pedantic(sweep, (store, wanted, [Contestant(engine="auto", limit=LIMIT)]), rounds=1)
    page(store, RESULTS)
    for case in wanted:
        found = figures(store.find(case.name, "auto", LIMIT) or {}, case.load())
        row("Scale: auto for 10 s", **found)
        assert found["memory, MiB"] < MEMORY_MIB

"""The page of each family: what is compared, and by which measure."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bench.peers import markdown
from bench.peers.families import best_known
from bench.peers.markdown import plan_text
from bench.peers.measures import at, best_of, geometric_mean, primal_integral, relative_gap
from bench.peers.store import Store

Runs = dict[tuple[str, str, float], dict[str, Any]]
OURS = (0.5, 2.0, 10.0)
EXACT = ("highs", "scip", "cpsat", "gurobi")
HEURISTICS = ("cft", "ortools_cover", "setcoverpy")


def runs_of(store: Store) -> Runs:
    """By instance, contestant and limit."""
    return {(run["instance"], run["contestant"], run["limit"]): run for run in store.runs.values()}


def _instances(runs: Runs, order: Iterable[str]) -> list[str]:
    measured = {name for name, _, _ in runs}
    return [name for name in order if name in measured]


def _longest(runs: Runs, instance: str, contestant: str) -> dict[str, Any] | None:
    limits = [limit for name, who, limit in runs if (name, who) == (instance, contestant)]
    return runs[instance, contestant, max(limits)] if limits else None


def side_by_side(runs: Runs, order: Iterable[str], ours: tuple[float, ...], peers: tuple[str, ...]) -> list[dict[str, Any]]:
    """One row an instance: plan and bound of ours at each limit, of each peer at its limit."""
    rows = []
    for name in _instances(runs, order):
        row: dict[str, Any] = {"instance": name}
        for limit in ours:
            row[f"auto {limit:g} s"] = plan_text(runs.get((name, "auto", limit)))
        for peer in peers:
            run = _longest(runs, name, peer)
            row[peer] = plan_text(run) + (f" {min(run['limit'], run['seconds']):.3g} s" if run else "")
        rows.append(row)
    return rows


def against(runs: Runs, order: Iterable[str], limit: float, peers: tuple[str, ...]) -> list[dict[str, Any]]:
    """One row a peer: where ours is better, level and worse, primal integrals and proven gaps, on common instances."""
    rows = []
    names = _instances(runs, order)
    for peer in peers:
        pairs = []
        for name in names:
            mine, other = runs.get((name, "auto", limit)), _longest(runs, name, peer)
            if mine is not None and other is not None:
                pairs.append((name, mine, other))
        if pairs:
            rows.append({"peer": peer, "instances": len(pairs), **_compare(runs, limit, pairs)})
    return rows


def _compare(runs: Runs, limit: float, pairs: list[tuple[str, dict[str, Any], dict[str, Any]]]) -> dict[str, Any]:
    plan, bound, integral, gaps = [0, 0, 0], [0, 0, 0], [], []
    for name, mine, other in pairs:
        best = best_of(run for (instance, _, _), run in runs.items() if instance == name)
        (my_plan, my_bound), (its_plan, its_bound) = at(mine["trace"], limit), at(other["trace"], other["limit"])
        plan[_order(my_plan, its_plan)] += 1
        bound[_order(-my_bound, -its_bound)] += 1
        # A floor of one part in a thousand: a run that is at the best known at once would make the ratio infinite.
        means = [max(1e-3, primal_integral(run["trace"], best, limit)) for run in (mine, other)]
        integral.append(means[0] / means[1])
        gaps.append((relative_gap(my_plan, my_bound), relative_gap(its_plan, its_bound)))
    theirs = sorted({other["limit"] for _, _, other in pairs})
    return {
        "ours": f"{limit:g} s",
        "theirs": f"{'/'.join(f'{t:g}' for t in theirs)} s",
        "plan better/same/worse": "/".join(map(str, plan)),
        "bound better/same/worse": "/".join(map(str, bound)),
        "primal integral over our time, ours / theirs": geometric_mean(integral),
        "mean proven gap, ours": sum(a for a, _ in gaps) / len(gaps),
        "mean proven gap, theirs": sum(b for _, b in gaps) / len(gaps),
        "proven gap, ours / theirs": sum(a for a, _ in gaps) / max(1e-12, sum(b for _, b in gaps)),
        "proven optimal, ours/theirs": f"{sum(a == 0 for a, _ in gaps)}/{sum(b == 0 for _, b in gaps)}",
    }


def _order(mine: float, other: float) -> int:
    """0, 1 or 2: less, the same, more."""
    return 1 if math.isclose(mine, other, rel_tol=1e-9) else 0 if mine < other else 2


def _each(runs: Runs, order: Iterable[str], limit: float, peers: tuple[str, ...]) -> list[dict[str, Any]]:
    """Primal integrals by instance over the limit of ours, and over the peers' with ours standing still after its end."""
    rows = []
    for name in _instances(runs, order):
        mine = runs.get((name, "auto", limit))
        best = best_of(run for (instance, _, _), run in runs.items() if instance == name)
        row: dict[str, Any] = {"instance": name, "best known": best}
        found = {"auto": mine} | {peer: _longest(runs, name, peer) for peer in peers}
        long = max((run["limit"] for run in found.values() if run), default=limit)
        for horizon in sorted({limit, long}):
            for who, run in found.items():
                known = run is not None and (run["limit"] >= horizon or who == "auto")
                row[f"{who} {horizon:g} s"] = primal_integral(run["trace"], best, horizon) if run and known else None
        rows.append(row)
    return rows


def piles(store: Store, order: list[str]) -> None:
    """`piles.md`."""
    runs = runs_of(store)
    markdown.write(
        store.path.with_suffix(".md"),
        "Dense garment piles",
        [
            markdown.CLOCK,
            "Plan [bound]; ✓ where they meet. Peers: formulation `clique` (rows scaled and truncated, one a clique), which "
            "beat the pairwise one; HiGHS and SCIP at their default settings, CP-SAT with one worker.",
            markdown.table(side_by_side(runs, order, OURS, EXACT)),
            "## Against each peer",
            markdown.table([row for limit in OURS for row in against(runs, order, limit, EXACT)]),
            "## Primal integrals",
            "Mean distance to the best known plan over the time, 1 while there is none; ours stands still after 10 s.",
            markdown.table(_each(runs, order, 10.0, EXACT)),
            markdown.provenance(list(runs.values())),
        ],
    )


def covers(store: Store, order: list[str]) -> None:
    """`covers.md`."""
    runs = runs_of(store)
    limits = tuple(sorted({limit for _, who, limit in runs if who == "auto"}))
    peers = (*HEURISTICS, *EXACT)
    rows = side_by_side(runs, order, limits, peers)
    for row in rows:
        row["best known"] = best_known()[row["instance"]]
        for limit in limits:
            run = runs.get((row["instance"], "auto", limit))
            if run and run["objective"]:
                row[f"above best known, {limit:g} s"] = f"{100 * (run['objective'] / row['best known'] - 1):.2f} %"
    markdown.write(
        store.path.with_suffix(".md"),
        "OR-Library set cover",
        [
            markdown.CLOCK,
            "CFT: the heuristic of Caprara, Fischetti and Toth (pycft); it stops by its own rule or its limit, "
            "and tells its plan and bound at its end only (its primal integral: waiting for "
            "it). ortools_cover: greedy and steepest descent of OR-tools after random removals, in a loop. "
            "SetCoverPy is left out: it needs more than 180 s where CFT needs one.",
            markdown.table(rows),
            *([markdown.table(against(runs, order, limits[-1], peers))] if limits else []),
            markdown.provenance(list(runs.values())),
        ],
    )


def probabilistic(store: Store, order: list[str]) -> None:
    """`probabilistic.md`."""
    runs = runs_of(store)
    limits = tuple(sorted({limit for _, who, limit in runs if who == "auto"}))
    markdown.write(
        store.path.with_suffix(".md"),
        "Probabilistic set cover on OR-Library incidence",
        [
            markdown.CLOCK,
            "p uniform in [0.3, 0.95), q for all rows (at most 80 % of a supply), -cK: disjoint random cliques of K.",
            markdown.table(side_by_side(runs, order, limits, EXACT)),
            *([markdown.table(against(runs, order, limits[-1], EXACT))] if limits else []),
            markdown.provenance(list(runs.values())),
        ],
    )


PAGES = {"piles": piles, "covers": covers, "probabilistic": probabilistic}


def write(family: str, folder: Path, order: list[str]) -> None:
    """Write the page of a family from its results, if there are any."""
    store = Store(folder / f"{family}.json")
    if store.runs:
        PAGES[family](store, order)

"""Which figures moved by more than noise between two files of results: `python bench/compare.py OLD.json NEW.json`.

Times of two runs are never compared with each other. A figure is a ratio within one file, of a contestant to a peer on the
same instance: of objectives, of gaps to the better plan, of primal integrals. Between the files the ratios are paired by
instance; a figure moved if the mean change of its logarithm is more than twice its standard error and more than `LEAST`.
The exit status is 1 if one moved for the worse.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1]))

from bench.peers.measures import at, primal_integral, relative_gap

LEAST = {"plan": 0.002, "unproven": 0.02, "primal integral": 0.05}
"""Changes below these parts are not worth a line."""
FLOOR = 1e-3
"""Gaps and integrals are raised to this before their ratio is taken."""
CERTAIN = 2.0
FEWEST = 3
"""Fewer common instances say nothing."""

Key = tuple[str, str, float, int]
Runs = dict[Key, dict[str, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One figure in both files: geometric means of its ratio, and the error of the mean change of its logarithm."""

    figure: str
    contestant: str
    peer: str
    instances: int
    old: float
    new: float
    error: float

    @property
    def moved(self) -> bool:
        """Whether it changed by more than noise."""
        by = abs(math.log(self.new / self.old))
        return self.instances >= FEWEST and by > CERTAIN * self.error and by > LEAST[self.figure]

    def __str__(self) -> str:
        word = ("better" if self.new < self.old else "WORSE") if self.moved else "level"
        name = f"{self.figure}, {self.contestant} / {self.peer}"
        return (
            f"{word:7}{name:60} {self.old:.4g} -> {self.new:.4g}  (+- {100 * self.error:.1f} %, {self.instances} instances)"
        )


class Different(Exception):
    """Two files hold different problems under one name."""


def load(path: Path) -> Runs:
    """The runs of a file, by instance, contestant, limit and seed."""
    runs = json.loads(path.read_text())["runs"].values()
    return {(run["instance"], run["contestant"], run["limit"], run["seed"]): run for run in runs}


def changes(old: Runs, new: Runs) -> Iterator[Change]:
    """Every figure of ours that both files have.

    Raises
    ------
    Different
        If an instance of the same name is another problem.
    """
    for key in sorted(old.keys() & new.keys()):
        if old[key]["digest"] != new[key]["digest"]:
            raise Different(f"{key[0]}: expected one problem in both files, got two digests; compare results of one family")
    both = sorted(old.keys() & new.keys())
    who = sorted({(contestant, limit) for _, contestant, limit, _ in both})
    ours = [one for one in who if one[0].startswith("auto")]
    for mine in ours:
        for peer in who:
            if peer in ours:
                continue
            shared = [k for k in both if k[1:3] == mine and (k[0], *peer, k[3]) in old and (k[0], *peer, k[3]) in new]
            for figure in LEAST:
                pairs = [tuple(math.log(_ratio(runs, key, peer, figure)) for runs in (old, new)) for key in shared]
                if pairs:
                    yield _change(figure, mine, peer, pairs)


def _change(figure: str, mine: tuple[str, float], peer: tuple[str, float], pairs: list[tuple[float, ...]]) -> Change:
    steps = [b - a for a, b in pairs]
    error = statistics.stdev(steps) / math.sqrt(len(steps)) if len(steps) > 1 else math.inf
    return Change(
        figure=figure,
        contestant=f"{mine[0]} {mine[1]:g} s",
        peer=f"{peer[0]} {peer[1]:g} s",
        instances=len(pairs),
        old=math.exp(statistics.fmean(a for a, _ in pairs)),
        new=math.exp(statistics.fmean(b for _, b in pairs)),
        error=error,
    )


def _ratio(runs: Runs, key: Key, peer: tuple[str, float], figure: str) -> float:
    mine, other = runs[key], runs[key[0], *peer, key[3]]
    return _worth(mine, other, key[2], figure) / _worth(other, mine, key[2], figure)


def _worth(run: dict[str, Any], rival: dict[str, Any], seconds: float, figure: str) -> float:
    """A figure of a run, the lower the better and above 0."""
    plans = [one["objective"] for one in (run, rival) if one["objective"] is not None]
    best = min(plans, default=1.0)
    objective, bound = at(run["trace"], math.inf)
    if figure == "plan":
        # Without a plan as bad as one that is twice as dear as the best.
        return objective if math.isfinite(objective) else 2.0 * best
    if figure == "unproven":
        return max(FLOOR, relative_gap(best, bound))
    return max(FLOOR, primal_integral(run["trace"], best, seconds))


def main() -> int:
    """Print every figure, those that moved first."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    given = parser.parse_args()
    try:
        found = sorted(changes(load(given.old), load(given.new)), key=lambda one: (not one.moved, one.new < one.old))
    except (Different, OSError, KeyError, ValueError) as problem:
        parser.error(f"{type(problem).__name__}: {problem}")
    for one in found:
        sys.stdout.write(f"{one}\n")
    if not found:
        sys.stdout.write("no run of ours together with a peer's is in both files\n")
    return int(any(one.moved and one.new > one.old for one in found))


if __name__ == "__main__":
    sys.exit(main())

"""Measure what is missing in a family's results: `python bench/peers/contest.py piles --run highs:60 scip:60`.

Every contestant runs in a process of its own, one at a time, on the same instance, one thread, and is given CPU seconds
(of its process and of its workers), so that other work on the machine changes little. Each run is written to
`bench/results/FAMILY.json` as it ends, and is not measured again unless asked: a sweep that was killed goes on. At the end,
and without `--run` at once, the page `FAMILY.md` is written from all results.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from bench.peers import families, pages
from bench.peers.families import Case
from bench.peers.runner import Contestant
from bench.peers.store import RESULTS, Store, sweep

FAMILIES: dict[str, Callable[[], list[Case]]] = {
    "piles": families.piles,
    "covers": families.covers,
    "probabilistic": families.probabilistic,
}


def contestant(text: str) -> Contestant:
    """From `engine:seconds`."""
    engine, _, seconds = text.partition(":")
    return Contestant(engine=engine, limit=float(seconds))


def main() -> None:
    """Run the sweep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=FAMILIES)
    parser.add_argument("--run", nargs="+", type=contestant, default=[], metavar="ENGINE:SECONDS")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these instances, in this order")
    parser.add_argument("--again", action="store_true", help="measure also what has been measured")
    parser.add_argument("--results", type=Path, default=RESULTS, help="the folder of the results")
    given = parser.parse_args()
    cases = {case.name: case for case in FAMILIES[given.family]()}
    unknown = [name for name in given.only or () if name not in cases]
    if unknown:
        parser.error(f"no instance {unknown[0]!r} in {given.family}; there are {', '.join(cases)}")
    chosen = [cases[name] for name in given.only or cases]
    sweep(Store(given.results / f"{given.family}.json"), chosen, given.run, again=given.again)
    pages.write(given.family, given.results, list(cases))


if __name__ == "__main__":
    main()

"""The instances of the contests: seeded families, each instance made when it is asked for and kept as a file."""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pscover.generate.garments import garments
from pscover.generate.piles import reachable
from pscover.generate.psc import psc_on_incidence
from pscover.grasping.candidates import candidates
from pscover.grasping.sampling import Sampling
from pscover.instance import Instance
from pscover.io import load_instance, save_instance
from pscover.scene import Scene

ORLIB = Path(__file__).parents[3] / "shared" / "orlib"
KEPT = Path(tempfile.gettempdir()) / "pscover-bench-instances"

PILE = (282, 470)
"""Pixels of the paper's workspace, for piles of up to 100 garments; twice as wide and high for more."""
DROPPED = {35: 35, 60: 60, 100: 100, 200: 207, 8: 8}
"""Garments dropped so that as many as asked for are left once those that nobody can reach are taken away."""
STRICTEST = 0.95


@dataclass(frozen=True, slots=True)
class Case:
    """One instance of a family, by name; `get` makes it."""

    name: str
    get: Callable[[], Instance]

    def load(self) -> Instance:
        """The instance, from the file it was kept in or made anew."""
        path = KEPT / f"{self.name}.npz"
        if path.exists():
            return load_instance(path)
        instance = self.get()
        KEPT.mkdir(exist_ok=True)
        save_instance(instance, path)
        return instance


@cache
def pile(count: int, seed: int = 0) -> Scene:
    """Garments dropped over each other, each of which can be reached with probability 0.95 by 5 and by 20 points a part.

    In a dense pile a garment may show too little for any plan. Such garments are taken away, which is the lower density
    that the requirement needs; how many were dropped is chosen so that `count` are left.
    """
    scene = garments(
        DROPPED.get(count, count), seed, layout="piled", size=PILE if count <= 100 else (2 * PILE[0], 2 * PILE[1])
    )
    return reachable(scene, STRICTEST, points=(5, 20))


def piles(counts: tuple[int, ...] = (35, 60, 100, 200)) -> list[Case]:
    """Dense garment piles, easy to hard: 24 instances, seed 0."""
    settings = [(count, points, q) for count in counts for points in (5, 20) for q in (0.7, 0.9, 0.95)]
    # Large ones with many candidates come last: a sweep that is cut short has the rest.
    settings.sort(key=lambda one: one[0] * one[1])
    return [Case(f"pile{count}-k{points}-q{q:g}", _of_pile(count, points, q)) for count, points, q in settings]


def _of_pile(count: int, points: int, required: float) -> Callable[[], Instance]:
    return lambda: candidates(pile(count), sampling=Sampling(points=points), required=required)


@cache
def best_known() -> dict[str, float]:
    """Best known values of the OR-Library files, by name."""
    return {line["name"]: float(line["best_known"]) for line in _index()}


@cache
def sizes() -> dict[str, int]:
    """Rows or columns, whichever are more, by name."""
    return {line["name"]: max(int(line["rows"]), int(line["cols"])) for line in _index()}


def _index() -> list[dict[str, str]]:
    with (ORLIB / "INDEX.tsv").open() as file:
        return list(csv.DictReader(file, delimiter="\t"))


EASY = 300
"""Files of fewer columns and rows than this are no contest."""


def covers() -> list[Case]:
    """Plain set cover of the OR-Library: all sets, the railways and the combinatorial ones but the smallest."""
    return [Case(name, _read(name)) for name, size in sizes().items() if size >= EASY]


def _read(name: str) -> Callable[[], Instance]:
    return lambda: load_instance(ORLIB / f"{name}.txt")


PROBABILISTIC = ("scp41", "scp61", "scpa1", "scpd1", "scpnre1")
CLIQUE = {0.9: 10, 0.99: 5}
"""Members of a clique: tighter requirements with smaller ones, or nothing is feasible."""


def probabilistic() -> list[Case]:
    """Random probabilities on incidence of the OR-Library, q = 0.9 and 0.99, without and with disjoint cliques."""
    return list(_probabilistic())


def _probabilistic() -> Iterator[Case]:
    for required in (0.9, 0.99):
        for size in (None, CLIQUE[required]):
            for name in PROBABILISTIC:
                yield Case(f"{name}-q{required:g}" + (f"-c{size}" if size else ""), _on(name, required, size))


def _on(name: str, required: float, size: int | None) -> Callable[[], Instance]:
    return lambda: psc_on_incidence(load_instance(ORLIB / f"{name}.txt"), required=required, clique_size=size, seed=1)

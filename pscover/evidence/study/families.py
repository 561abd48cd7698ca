"""The instances of the study: seeded families, from tables of garments to covers of the OR-Library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from pscover.errors import InvalidInstance, UnknownName
from pscover.generate.garments import garments
from pscover.generate.piles import reachable
from pscover.generate.psc import psc_on_incidence, random_psc
from pscover.grasping.candidates import candidates
from pscover.instance import Instance, Meta
from pscover.io import load_instance

REQUIRED = 0.7
"""The paper's q."""
PSC_REQUIRED = 0.8
"""Of the probabilistic covers: with 0.9 no engine proves any of them in a minute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One instance by name.

    Parameters
    ----------
    family
        One of `FAMILIES`.
    seed
        Of everything random.
    file
        Name of the OR-Library's file that it is made of, or "" for a generated stand-in, and for garments.
    """

    family: str
    seed: int
    file: str = ""


Folder = Path | None
"""Of OR-Library files."""


@dataclass(frozen=True, slots=True)
class Family:
    """What the instances of a family are, in words, how one is made, and whether of a file of the OR-Library."""

    what: str
    make: Callable[[Problem, Folder], Instance]
    of_files: bool = False


def _apart(problem: Problem, _: Folder) -> Instance:
    return candidates(garments(20, problem.seed), required=REQUIRED, seed=problem.seed)


def _groups(problem: Problem, _: Folder) -> Instance:
    scene = reachable(garments(15, problem.seed, groups=(5, 5, 5)), REQUIRED)
    return candidates(scene, required=REQUIRED, seed=problem.seed)


def _pile(problem: Problem, _: Folder) -> Instance:
    scene = reachable(garments(8, problem.seed, layout="piled"), REQUIRED)
    return candidates(scene, required=REQUIRED, seed=problem.seed)


COVERS = ("scp41", "scp42", "scp43", "scp44", "scp45", "scp46", "scp47", "scp48", "scp49", "scp410")
"""200 elements, 1000 sets of about four elements, costs from 1 to 100."""


def _cover(problem: Problem, folder: Folder) -> Instance:
    if problem.file and folder is not None:
        return load_instance(folder / f"{problem.file}.txt")
    drawn = random_psc(200, 1000, covers=4, low=1.0, high=1.0, required=0.5, cheapest=1, dearest=100, seed=problem.seed + 1)
    return Instance.of(drawn.probability, 0.5, drawn.cost, meta=drawn.meta)


def _part(problem: Problem, folder: Folder, elements: int, sets: int) -> Instance:
    """The first elements of a cover, and the first sets that hold some of them: nobody proves whole ones."""
    cover = _cover(problem, folder)
    rows = cover.probability[:elements, :]
    some = np.flatnonzero(np.diff(rows.indptr))[:sets]
    return Instance.of(rows[:, some], 0.5, cover.cost[some], meta=Meta(name=cover.meta.name))


def _psc(problem: Problem, folder: Folder) -> Instance:
    return psc_on_incidence(_part(problem, folder, 70, 350), required=PSC_REQUIRED, seed=problem.seed)


def _psc_cliques(problem: Problem, folder: Folder) -> Instance:
    part = _part(problem, folder, 50, 250)
    return psc_on_incidence(part, required=PSC_REQUIRED, clique_size=3, seed=problem.seed)


FAMILIES = {
    "apart": Family("20 garments apart, the paper's settings", _apart),
    "groups": Family("15 garments in three groups of five that overlap, the paper's settings", _groups),
    "pile": Family("8 garments dropped over each other, the paper's settings", _pile),
    "psc": Family("probabilities on 70 × 350 of an OR-Library cover, q = 0.8", _psc, of_files=True),
    "psc-cliques": Family(
        "probabilities on 50 × 250 of it, q = 0.8, disjoint cliques of three", _psc_cliques, of_files=True
    ),
    "cover": Family("set cover of the OR-Library, 200 × 1000: certain candidates, no conflicts", _cover, of_files=True),
}


def family(name: str) -> Family:
    """The family of a name.

    Raises
    ------
    UnknownName
        With the nearest name and all known ones.
    """
    if name not in FAMILIES:
        raise UnknownName.among("family", name, FAMILIES)
    return FAMILIES[name]


def problem_of(name: str, seed: int, folder: Folder = None) -> Problem:
    """The instance of a family with that seed, made of a file of the OR-Library where the folder has it.

    Raises
    ------
    UnknownName
        If there is no such family.

    Examples
    --------
    >>> problem_of("cover", 0)
    Problem(family='cover', seed=0, file='')
    """
    file = COVERS[seed % len(COVERS)] if family(name).of_files else ""
    there = folder is not None and (folder / f"{file}.txt").exists()
    return Problem(family=name, seed=seed, file=file if there else "")


@lru_cache(maxsize=4)
def instance_of(problem: Problem, folder: Folder = None) -> Instance:
    """The instance, made anew; the last few are remembered.

    Raises
    ------
    InvalidInstance
        If its file is not in the folder.

    Examples
    --------
    >>> instance_of(Problem(family="psc", seed=0)).elements
    70
    """
    if problem.file and folder is None:
        raise InvalidInstance(f"{problem.family}: expected a folder with {problem.file}.txt of the OR-Library, got none")
    return family(problem.family).make(problem, folder)

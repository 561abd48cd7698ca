"""Why an instance has no plan: elements that cannot reach their requirement, and the cliques that bind.

The most an element can reach is a maximum-weight conflict-free set among the candidates that cover it. Where the cliques
are disjoint within those candidates (as within a partition of the paper) that is the best candidate of each clique;
otherwise a small branch and bound finds it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.clock import Clock
from pscover.instance import TOLERANCE, Instance

NODE_LIMIT = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Unreachable:
    """An element that no plan can cover often enough.

    Parameters
    ----------
    element
        Its index.
    required
        q_j.
    reach
        The highest coverage found with conflict-free candidates.
    ceiling
        Proven: no conflict-free set reaches more. Equal to `reach` unless the search ran into its limit.
    cliques
        Cliques that bind: those with at least two candidates that cover the element.
    """

    element: int
    required: float
    reach: float
    ceiling: float
    cliques: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Unmet:
    """An element that the fewest-unmet plan leaves short, though it could be covered alone.

    Parameters
    ----------
    element, required
        Its index and q_j.
    coverage
        What it gets in that plan.
    cliques
        Cliques in which that plan's pick blocks a candidate that would cover the element better.
    """

    element: int
    required: float
    coverage: float
    cliques: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Why no plan exists.

    Parameters
    ----------
    unreachable
        Elements whose requirement is out of reach whatever else is chosen: each alone proves infeasibility.
    unmet
        If there are none: the elements that a plan with the fewest unmet requirements leaves short.
    """

    unreachable: tuple[Unreachable, ...]
    unmet: tuple[Unmet, ...] = ()


def unreachable(instance: Instance, seconds: float = math.inf) -> tuple[Unreachable, ...]:
    """The elements that cannot reach their requirement, with the most each can reach and the cliques that bind.

    Parameters
    ----------
    instance
        The problem.
    seconds
        How long to look; what was found by then is returned.

    Examples
    --------
    >>> instance = Instance.of([[0.6, 0.6, 0.5]], required=0.85, conflicts=[(0, 1)])
    >>> [(u.element, round(u.reach, 3), u.cliques) for u in unreachable(instance)]
    [(0, 0.8, (0,))]
    """
    by_element = instance.probability.tocsr()
    membership = csc_array(instance.conflicts.matrix(instance.candidates))
    clock = Clock(seconds)
    found = []
    for j in range(instance.elements):
        if clock.is_over:
            break
        span = slice(by_element.indptr[j], by_element.indptr[j + 1])
        columns, p = by_element.indices[span], by_element.data[span]
        required = float(instance.required[j])
        if required <= 0:
            continue
        order = np.argsort(-p, kind="stable")
        columns, p = columns[order], p[order]
        cliques = [membership.indices[membership.indptr[i] : membership.indptr[i + 1]] for i in columns]
        quick = _greedy(p, cliques)
        if required - quick <= TOLERANCE:
            continue
        reach, ceiling = _most(p, cliques, clock)
        if required - ceiling <= TOLERANCE:
            continue
        shared, counts = np.unique(np.concatenate([*cliques, np.zeros(0, dtype=np.int32)]), return_counts=True)
        binding = tuple(int(k) for k in shared[counts > 1])
        found.append(Unreachable(element=j, required=required, reach=reach, ceiling=ceiling, cliques=binding))
    return tuple(found)


def unmet(instance: Instance, chosen: Sequence[int]) -> tuple[Unmet, ...]:
    """The elements that a plan leaves short, each with the cliques in which the plan's pick blocks a better candidate."""
    coverage = instance.coverage(chosen)
    short = np.flatnonzero(instance.required - coverage > TOLERANCE)
    by_candidate = instance.probability
    taken = np.zeros(instance.candidates, dtype=bool)
    taken[list(chosen)] = True
    found = []
    for j in short:
        p = np.zeros(instance.candidates)
        row = by_candidate[[int(j)], :].tocoo()
        p[row.col] = row.data
        binding = tuple(
            k
            for k, clique in enumerate(instance.conflicts)
            if taken[clique].any() and p[clique].max() > p[clique[taken[clique]]].max()
        )
        required, reached = float(instance.required[j]), float(coverage[j])
        found.append(Unmet(element=int(j), required=required, coverage=reached, cliques=binding))
    return tuple(found)


def _greedy(p: NDArray[np.float64], cliques: list[NDArray[np.int32]]) -> float:
    used: set[int] = set()
    missed = 1.0
    for value, member_of in zip(p, cliques, strict=True):
        if used.isdisjoint(member_of.tolist()):
            used.update(member_of.tolist())
            missed *= 1.0 - float(value)
    return 1.0 - missed


def _most(p: NDArray[np.float64], cliques: list[NDArray[np.int32]], clock: Clock) -> tuple[float, float]:
    """Highest coverage of a conflict-free set, and a proven ceiling. Candidates are sorted by falling probability.

    Depth first over the candidates in order; the bound of a node lets every clique of a partition of the rest add its
    best candidate only. Exact unless `NODE_LIMIT` nodes are visited or the time is over.
    """
    n = len(p)
    groups = [set(member_of.tolist()) for member_of in cliques]
    # Each candidate is counted in the first of its cliques, so that the rest falls into disjoint groups.
    first = [min(group) if group else -1 - i for i, group in enumerate(groups)]
    root = _partition_bound(p, first, range(n), set(), groups)
    best, nodes = _greedy(p, cliques), 0
    stack: list[tuple[int, float, frozenset[int]]] = [(0, 1.0, frozenset())]
    while stack:
        at, missed, used = stack.pop()
        best = max(best, 1.0 - missed)
        nodes += 1
        if nodes > NODE_LIMIT or clock.is_over:
            return best, 1.0 - root
        while at < n and not used.isdisjoint(groups[at]):
            at += 1
        if at == n or 1.0 - missed * _partition_bound(p, first, range(at, n), used, groups) <= best + TOLERANCE / 8:
            continue
        stack.append((at + 1, missed, used))
        stack.append((at + 1, missed * (1.0 - float(p[at])), used | groups[at]))
    return best, best + TOLERANCE / 8


def _partition_bound(
    p: NDArray[np.float64], first: list[int], rest: range, used: set[int] | frozenset[int], groups: list[set[int]]
) -> float:
    counted: set[int] = set()
    missed = 1.0
    for i in rest:
        if first[i] not in counted and used.isdisjoint(groups[i]):
            counted.add(first[i])
            missed *= 1.0 - float(p[i])
    return missed

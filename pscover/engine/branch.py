"""Small problems to proven optimality, at once and in plain Python: branch on a row that is short."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .problem import TOLERANCE, IntArray, Problem

SMALL = 60
"""Most candidates of a problem that is worth trying."""
NODES = 3000
"""Nodes after which the search gives up."""


@dataclass(slots=True)
class _Tree:
    cost: list[float]
    columns: list[list[tuple[int, float]]]
    lines: list[list[tuple[int, float]]]
    cliques: list[list[int]]
    nodes: int
    step: float
    best: float
    plan: list[int] | None = None
    chosen: list[int] = field(default_factory=list)
    shut: list[int] = field(default_factory=list)
    """How many reasons keep each candidate out."""
    members: list[list[int]] = field(default_factory=list)

    def visit(self, deficit: list[float], spent: float) -> None:
        """Explore all plans that contain the choices so far and none of those shut out."""
        self.nodes -= 1
        if self.nodes < 0:
            return
        narrow: list[tuple[int, float]] | None = None
        least = 0.0
        for j, short in enumerate(deficit):
            if short <= TOLERANCE:
                continue
            open_ = [(i, w) for i, w in self.lines[j] if not self.shut[i]]
            least = max(least, self._least(open_, short))
            if narrow is None or len(open_) < len(narrow):
                narrow = open_
        if narrow is None:
            if spent < self.best - max(0.5 * self.step, 1e-12):
                self.best, self.plan = spent, list(self.chosen)
            return
        if spent + least > self.best - self.step + 1e-9:
            return
        closed = []
        for i, _ in narrow:
            together = [k for clique in self.cliques[i] for k in self.members[clique]]
            for k in together:
                self.shut[k] += 1
            self.shut[i] += 1
            self.chosen.append(i)
            after = list(deficit)
            for j, w in self.columns[i]:
                after[j] -= w
            self.visit(after, spent + self.cost[i])
            self.chosen.pop()
            for k in together:
                self.shut[k] -= 1
            # Stays shut for the candidates that follow: plans with it have been seen.
            closed.append(i)
        for i in closed:
            self.shut[i] -= 1

    def _least(self, open_: list[tuple[int, float]], short: float) -> float:
        """What meeting one row costs at least: its relaxation, at most one candidate a clique left out."""
        total = 0.0
        for i, w in open_:
            if w >= short:
                return total + self.cost[i] * short / w
            total += self.cost[i]
            short -= w
            if short <= TOLERANCE:
                return total
        return float("inf")


def branch(
    problem: Problem, *, upper: float = np.inf, step: float = 0.0, nodes: int = NODES
) -> tuple[bool, IntArray | None]:
    """The best plan cheaper than `upper`, by branch and bound.

    Parameters
    ----------
    problem
        The rows and cliques.
    upper
        The cost of a plan at hand.
    step
        By how much a plan must at least be cheaper to count.
    nodes
        After so many the search gives up.

    Returns
    -------
    finished
        Whether all plans were looked at.
    plan
        The best plan, sorted, or None if none was found: with `finished`, there is none below `upper`.
    """
    n = problem.candidates
    line = problem.lines
    members: list[list[int]] = [[] for _ in range(int(problem.cliques[0]))]
    cliques = [problem.gclq[problem.gptr[i] : problem.gptr[i + 1]].tolist() for i in range(n)]
    for i, listed in enumerate(cliques):
        for clique in listed:
            members[clique].append(i)
    column = problem.columns
    tree = _Tree(
        cost=problem.cost.tolist(),
        columns=[_pairs(column["row"], column["entry"], problem.cptr, i) for i in range(n)],
        lines=[_pairs(line["candidate"], line["entry"], problem.rptr, j) for j in range(problem.rows)],
        cliques=cliques,
        nodes=nodes,
        step=step,
        best=upper,
        shut=[0] * n,
        members=members,
    )
    tree.visit([1.0] * problem.rows, 0.0)
    plan = None if tree.plan is None else np.sort(np.array(tree.plan, dtype=np.int32))
    return tree.nodes >= 0, plan


def _pairs(index: IntArray, value: IntArray, starts: IntArray, k: int) -> list[tuple[int, float]]:
    span = slice(starts[k], starts[k + 1])
    return list(zip(index[span].tolist(), value[span].tolist(), strict=True))

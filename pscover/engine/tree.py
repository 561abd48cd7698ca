"""Small problems to proven optimality where no sweep can: branch and bound, each node bounded by its rows one by one.

A node is what is taken and which entries are left; prices (`rowwise`) begin where those of its parent ended, and leave out
what no better plan has. It branches on a group, the largest clique of each candidate or the candidate alone: on one of its
candidates after the other, then on none of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import rowwise
from .problem import TOLERANCE, FloatArray, IntArray, Problem
from .rowwise import Shares, improve, laid
from .sweep import worth

STEPS, GLANCE = 20, 5
"""Steps on the prices of a node at most, and between two looks at whether they will do."""
LENGTH = 0.1
"""Of the first step at a node."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Node:
    """Plans that have some candidates, and others only of those that are left.

    Parameters
    ----------
    taken
        What they have.
    entries
        What else they may have: entries of rows that still need something, in their order.
    share, mean
        Of each of these: its part of the price, and how often it was chosen lately.
    lower
        What these plans cost at least.
    """

    taken: tuple[int, ...]
    entries: IntArray
    share: FloatArray
    mean: FloatArray
    lower: float


class Branching:
    """A depth-first search in short turns; its nodes depend on the problem, its prices and the plans it knows only.

    Parameters
    ----------
    problem
        The rows and cliques.
    priced
        Prices of the rows' entries to begin with.
    upper
        The cost of a plan at hand.
    step
        By how much a plan must at least be cheaper to count; 0 for the least that can be told apart.
    """

    def __init__(self, problem: Problem, priced: Shares, upper: float = math.inf, step: float = 0.0) -> None:
        self.problem, self.upper, self.step = problem, upper, step
        self.plan: IntArray | None = None
        self.nodes = self.work = 0
        self._priced = priced
        self._row, order = laid(problem)
        self._amount = problem.lines["entry"][order]
        self._home = np.unique(problem.homes, return_inverse=True)[1]
        member = np.repeat(np.arange(problem.candidates), np.diff(problem.gptr))
        order = np.argsort(problem.gclq, kind="stable")
        ends = np.searchsorted(problem.gclq[order], np.arange(int(problem.cliques[0]) + 1))
        self._members = np.split(member[order], ends[1:-1])
        every = np.arange(len(problem.lines), dtype=np.int32)
        self._stack = [Node(taken=(), entries=every, share=priced.kept.copy(), mean=np.full(len(every), -1.0), lower=0.0)]

    @property
    def is_finished(self) -> bool:
        """Whether no node is left."""
        return not self._stack

    @property
    def lower(self) -> float:
        """What every plan costs at least that is still to be found."""
        return min((node.lower for node in self._stack), default=math.inf)

    @property
    def _most(self) -> float:
        """What a plan that is better than the one at hand may cost."""
        return worth(self.upper, self.step)

    def turn(self, work: int) -> bool:
        """Go on for so much work, until a better plan is found, or to the end; whether one was found."""
        end = self.work + work
        while self._stack and self.work < end:
            node = self._stack.pop()
            if node.lower <= self._most and self._explore(node):
                return True
        return False

    def know(self, upper: float) -> None:
        """A plan of that cost is at hand."""
        self.upper = min(upper, self.upper)

    def _explore(self, node: Node) -> bool:
        """Bound a node, and put its children on the stack; whether it was a better plan."""
        self.nodes += 1
        taken = np.array(node.taken, dtype=np.int64)
        need, spent = self._need(taken), float(self.problem.cost[taken].sum())
        if not (need > 0).any():
            self.plan, self.upper = np.sort(taken).astype(np.int32), spent
            self.work += 1
            return True
        priced = self._shares(node, need)
        bound = self._bound(priced, self._most - spent)
        lower = max(node.lower, spent + bound)
        if lower > self._most or math.isinf(lower):
            return False
        stays = spent + bound + priced.penalty[priced.candidate] <= self._most
        if stays.any():
            self._branch(node, priced, stays, lower, spent + bound)
        return False

    def _need(self, taken: NDArray[np.int64]) -> FloatArray:
        """What each row still needs."""
        need = np.full(self.problem.rows, 1.0 - TOLERANCE)
        for i in taken:
            column = self.problem.columns[self.problem.cptr[i] : self.problem.cptr[i + 1]]
            need[column["row"]] -= column["entry"]
        return need

    def _shares(self, node: Node, need: FloatArray) -> Shares:
        """Prices to begin with: what rows paid that need nothing any more, the others pay in proportion."""
        n = self.problem.candidates
        entries = node.entries
        candidate, row = self._priced.candidate[entries], self._row[entries]
        total = np.bincount(candidate, node.share, n)
        covers = np.bincount(candidate, minlength=n).astype(np.int32)
        none = total[candidate] <= 0
        share = np.where(none, 1.0 / covers[candidate], node.share / np.where(none, 1.0, total[candidate]))
        size = np.ceil(np.minimum(self._amount[entries] / need[row], 1.0) * self._priced.full - 1e-9)
        # Rows that need nothing are met by the price of nothing: they are left out.
        starts = np.searchsorted(row, np.flatnonzero(need > 0))
        rows = len(starts)
        share *= self.problem.cost[candidate] * (1 - 1e-14)
        return Shares(
            share=share,
            kept=share.copy(),
            mean=node.mean,
            starts=np.concatenate((starts, [len(row)])).astype(np.int32),
            candidate=candidate,
            group=self._priced.group[entries],
            units=size.astype(np.int32),
            covers=covers,
            full=self._priced.full,
            least=np.zeros(rows),
            low=np.zeros(rows, dtype=np.int32),
            high=np.full(rows, -1, dtype=np.int32),
            chosen=np.ones(len(entries), dtype=np.int32),
            penalty=np.zeros(n),
            value=np.array([-np.inf, LENGTH, 0.0, 0.0, 1.0]),
        )

    def _bound(self, priced: Shares, most: float) -> float:
        """What the rest costs at least, by a few steps, or fewer if that is more than the most."""
        goal = min(most, float(self.problem.cost.sum()))
        goal += 1e-6 * max(1.0, abs(goal))
        bound = -math.inf
        while bound <= goal and priced.value[rowwise.STEPS] < STEPS:
            before = priced.value[rowwise.STEPS]
            bound = float(improve(self.problem, priced, GLANCE, goal))
            self.work += GLANCE * (len(priced.share) + len(priced.starts))
            if priced.value[rowwise.STEPS] < before + GLANCE:
                break
        return bound

    def _branch(self, node: Node, priced: Shares, stays: NDArray[np.bool_], lower: float, bound: float) -> None:
        """Put the children on the stack, that of the cheapest candidate on top."""
        group = self._telling(priced, stays)
        here = np.unique(priced.candidate[stays])
        some = here[self._home[here] == group]
        for gone, taken in [(some, -1), *((some, i) for i in some[np.argsort(-priced.penalty[some], kind="stable")])]:
            out = np.zeros(self.problem.candidates, dtype=np.bool_)
            out[gone] = True
            least, more = lower, node.taken
            if taken >= 0:
                for g in self.problem.gclq[self.problem.gptr[taken] : self.problem.gptr[taken + 1]]:
                    out[self._members[g]] = True
                more = (*node.taken, int(taken))
                least = max(lower, bound + float(priced.penalty[taken]))
            short = self._need(np.array(more, dtype=np.int64)) > 0
            kept = stays & ~out[priced.candidate] & short[self._row[node.entries]]
            self._stack.append(
                Node(
                    taken=more,
                    entries=node.entries[kept],
                    share=priced.kept[kept],
                    mean=priced.mean[kept],
                    lower=least,
                )
            )

    def _telling(self, priced: Shares, stays: NDArray[np.bool_]) -> int:
        """The group on whose candidates rows disagree most, relative to how many there are."""
        n = self.problem.candidates
        candidate = priced.candidate[stays]
        mean = np.maximum(priced.mean[stays], 0.0)
        covers = np.maximum(np.bincount(candidate, minlength=n), 1)
        average = np.bincount(candidate, mean, n) / covers
        apart = np.bincount(candidate, (mean - average[candidate]) ** 2, n) + 1e-3 * average
        there = np.bincount(candidate, minlength=n) > 0
        many = np.bincount(self._home[there])
        score = np.bincount(self._home[there], apart[there] + 1e-9) / np.sqrt(np.maximum(many, 1))
        return int(np.argmax(score))

"""A tree of choices as the kernels keep it: what is in and out, what rows still need, and the way back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cheapest import Labels, labels
from .jit import inner
from .problem import TOLERANCE, FloatArray, IntArray, Problem

# Places in Tree.counts.
DEPTH, TRAIL, WORK, NODES, FRESH, FOUND, ENOUGH = range(7)
# Places in Tree.value.
UPPER, STEP, SPENT, LENGTH = range(4)
FREE, IN, OUT = range(3)
FOREVER = 1 << 62
DEEPEST = 120
"""Levels of the tree; a search that would go deeper gives up."""


class Tree(NamedTuple):
    """A depth-first search at any moment; all of it, so that it can be stopped and resumed.

    Entries are by row, those of a clique side by side; a candidate's price is shared out over its entries.

    Parameters
    ----------
    start
        Where each row's entries begin, shape (rows + 1,).
    candidate, group, amount
        Of each entry: its candidate, that one's group and by how much it meets the row.
    share, mean, chosen
        Of each entry: its part of the price, how often it was chosen lately, and whether it was in the last choice.
    is_open
        Of each entry: whether its candidate is undecided and its row not met.
    ptr, where
        The entries of each candidate.
    mptr, members
        The candidates of each clique.
    gptr, grouped
        The candidates of each group: the largest clique of each, or the candidate alone.
    need
        What each row still asks for.
    state
        Of each candidate: FREE, IN or OUT.
    trail, mark, pick, side
        The candidates decided, in order; of each level, how many had been when it began, the group that it branches on, and
        which candidate of the group it tries, none at first.
    lower, spent, prices, needs
        Of each level: its bound, what its choices cost, its shares and its rows.
    kept, sum, penalty
        The shares at the best bound of a node; sums over the entries of a candidate; by how much taking it raises the bound.
    least, gain, touched, tried, idle
        What each row costs on its own; by how much leaving out a group raises the bound, whether that was looked at, which
        entries were, and room for choices that are not used.
    flag, supply, held
        Of a plan on trial: its candidates, what each row gets, and how many it has of each clique.
    best
        Whether each candidate is in the best plan found.
    labels
        Room for the row at hand.
    counts, value
        Counters and amounts; see the names above.
    """

    start: IntArray
    candidate: IntArray
    group: IntArray
    amount: FloatArray
    share: FloatArray
    mean: FloatArray
    chosen: NDArray[np.bool_]
    is_open: NDArray[np.bool_]
    ptr: IntArray
    where: IntArray
    mptr: IntArray
    members: IntArray
    gptr: IntArray
    grouped: IntArray
    need: FloatArray
    state: IntArray
    trail: IntArray
    mark: IntArray
    pick: IntArray
    side: IntArray
    lower: FloatArray
    spent: FloatArray
    prices: FloatArray
    needs: FloatArray
    kept: FloatArray
    sum: FloatArray
    penalty: FloatArray
    least: FloatArray
    gain: FloatArray
    touched: NDArray[np.bool_]
    tried: NDArray[np.bool_]
    idle: NDArray[np.bool_]
    flag: NDArray[np.bool_]
    supply: FloatArray
    held: IntArray
    best: NDArray[np.bool_]
    labels: Labels
    counts: NDArray[np.int64]
    value: FloatArray


def tree(problem: Problem, upper: float, step: float) -> Tree:
    """The root: everything undecided, prices shared in proportion to the entries."""
    n, m, entries = problem.candidates, problem.rows, len(problem.lines)
    row = np.repeat(np.arange(m, dtype=np.int32), np.diff(problem.rptr))
    candidate = problem.lines["candidate"]
    home = np.where(problem.home < 0, int(problem.cliques[0]) + np.arange(n), problem.home)
    order = np.lexsort((home[candidate], row))
    candidate = candidate[order].astype(np.int32)
    amount = problem.lines["entry"][order]
    kinds, group = np.unique(home, return_inverse=True)
    total = np.bincount(candidate, amount, n)
    clique = problem.gclq
    member = np.repeat(np.arange(n, dtype=np.int32), np.diff(problem.gptr))
    cliques = int(problem.cliques[0])
    longest = int(np.diff(problem.rptr).max(initial=0))
    return Tree(
        start=problem.rptr,
        candidate=candidate,
        group=group[candidate].astype(np.int32),
        amount=np.ascontiguousarray(amount),
        share=amount / total[candidate] * problem.cost[candidate] * (1 - 1e-14),
        mean=np.full(entries, -1.0),
        chosen=np.zeros(entries, dtype=np.bool_),
        is_open=np.ones(entries, dtype=np.bool_),
        ptr=problem.cptr,
        where=np.argsort(candidate, kind="stable").astype(np.int32),
        mptr=np.concatenate(([0], np.cumsum(np.bincount(clique, minlength=cliques)))).astype(np.int32),
        members=member[np.argsort(clique, kind="stable")],
        gptr=np.concatenate(([0], np.cumsum(np.bincount(group, minlength=len(kinds))))).astype(np.int32),
        grouped=np.argsort(group, kind="stable").astype(np.int32),
        need=np.ones(m),
        state=np.zeros(n, dtype=np.int32),
        trail=np.zeros(n + 1, dtype=np.int32),
        mark=np.zeros(DEEPEST, dtype=np.int32),
        pick=np.full(DEEPEST, -1, dtype=np.int32),
        side=np.full(DEEPEST, -1, dtype=np.int32),
        lower=np.zeros(DEEPEST),
        spent=np.zeros(DEEPEST),
        prices=np.zeros((DEEPEST, entries)),
        needs=np.zeros((DEEPEST, m)),
        kept=np.zeros(entries),
        sum=np.zeros(n),
        penalty=np.zeros(n),
        least=np.zeros(m),
        gain=np.zeros(len(kinds)),
        touched=np.zeros(len(kinds), dtype=np.bool_),
        tried=np.zeros(entries, dtype=np.bool_),
        idle=np.zeros(entries, dtype=np.bool_),
        flag=np.zeros(n, dtype=np.bool_),
        supply=np.zeros(m),
        held=np.zeros(cliques, dtype=np.int32),
        best=np.zeros(n, dtype=np.bool_),
        labels=labels(longest),
        counts=np.array([0, 0, 0, 0, 1, 0, FOREVER], dtype=np.int64),
        value=np.array([upper, step, 0.0, 0.1]),
    )


@inner
def exclude(tree: Tree, i: int) -> None:
    """Leave a free candidate out."""
    tree.state[i] = OUT
    tree.trail[tree.counts[TRAIL]] = i
    tree.counts[TRAIL] += 1
    for s in range(tree.ptr[i], tree.ptr[i + 1]):
        tree.is_open[tree.where[s]] = False


@inner
def include(problem: Problem, tree: Tree, i: int) -> None:
    """Take a free candidate, and leave out what it excludes."""
    tree.state[i] = IN
    tree.trail[tree.counts[TRAIL]] = i
    tree.counts[TRAIL] += 1
    tree.value[SPENT] += problem.cost[i]
    for s in range(tree.ptr[i], tree.ptr[i + 1]):
        t = tree.where[s]
        tree.is_open[t] = False
    for s in range(problem.cptr[i], problem.cptr[i + 1]):
        j = problem.columns[s]["row"]
        tree.need[j] -= problem.columns[s]["entry"]
        if tree.need[j] <= TOLERANCE:
            for t in range(tree.start[j], tree.start[j + 1]):
                tree.is_open[t] = False
    for s in range(problem.gptr[i], problem.gptr[i + 1]):
        g = problem.gclq[s]
        for u in range(tree.mptr[g], tree.mptr[g + 1]):
            if tree.state[tree.members[u]] == FREE:
                exclude(tree, tree.members[u])


@inner
def enter(tree: Tree, pick: int, lower: float) -> None:
    """Begin a level that branches on a group."""
    depth = tree.counts[DEPTH]
    tree.mark[depth] = tree.counts[TRAIL]
    tree.pick[depth] = pick
    tree.side[depth] = tree.gptr[pick] - 1
    tree.lower[depth] = lower
    tree.spent[depth] = tree.value[SPENT]
    for t in range(len(tree.share)):
        tree.prices[depth, t] = tree.share[t]
    for j in range(len(tree.need)):
        tree.needs[depth, j] = tree.need[j]
    tree.counts[DEPTH] = depth + 1


@inner
def undo(tree: Tree) -> None:
    """Go back to where the last level began."""
    depth = tree.counts[DEPTH] - 1
    while tree.counts[TRAIL] > tree.mark[depth]:
        tree.counts[TRAIL] -= 1
        tree.state[tree.trail[tree.counts[TRAIL]]] = FREE
    tree.value[SPENT] = tree.spent[depth]
    for j in range(len(tree.need)):
        tree.need[j] = tree.needs[depth, j]
        is_short = tree.need[j] > TOLERANCE
        for t in range(tree.start[j], tree.start[j + 1]):
            tree.share[t] = tree.prices[depth, t]
            tree.is_open[t] = is_short and tree.state[tree.candidate[t]] == FREE


@inner
def advance(problem: Problem, tree: Tree) -> None:
    """Begin the next child of the last level.

    One candidate of its group after the other is tried, then none of them: what comes last is no level of its own.
    """
    undo(tree)
    depth = tree.counts[DEPTH] - 1
    g = tree.pick[depth]
    while tree.side[depth] < tree.gptr[g + 1]:
        tree.side[depth] += 1
        if tree.side[depth] < tree.gptr[g + 1]:
            i = tree.grouped[tree.side[depth]]
            if tree.state[i] == FREE:
                include(problem, tree, i)
                return
    tree.counts[DEPTH] = depth
    for s in range(tree.gptr[g], tree.gptr[g + 1]):
        if tree.state[tree.grouped[s]] == FREE:
            exclude(tree, tree.grouped[s])

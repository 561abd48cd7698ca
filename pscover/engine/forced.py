"""How a certificate charges the candidates that presolve found in every plan, and those that these exclude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.model import CoverForm
from pscover.proof import Part, Sweep

if TYPE_CHECKING:
    from .certify import Whole

FloatArray = NDArray[np.float64]
LongArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


class Forced:
    """What parts charge for the cliques of candidates that are in every plan.

    A row that cannot be met without such a candidate is a part of its own and is charged for it; other parts have it for
    nothing, and those of its clique that it replaces. The others of the clique, which no plan has, are dear in all parts:
    what is charged too much for the clique the row that needs it is charged as well, and what is left gives it back once.
    """

    def __init__(self, whole: Whole) -> None:
        self._whole = whole
        form, W, owner = whole.form, whole.W, whole.owner
        self._toll = np.full(len(form.c), np.nan)
        """What each entry of a candidate is charged."""
        self._need: dict[int, int] = {}
        forced = whole.reduced.forced
        if not len(forced):
            return
        group = _home(form)
        # More than rows pay for what is any use to them.
        dear = 2 * float(form.c.max())
        kept = np.isin(np.arange(W.shape[0]), whole.reduced.rows)
        blocked = {}
        for i in forced.tolist():
            peers = np.flatnonzero(group == group[i])
            blocked[i] = peers[~_replaced(W, peers, i, kept)]
        self._need = _needs(W, owner, group, blocked)
        charged = kept.astype(np.int64) + np.isin(np.arange(W.shape[0]), list(self._need.values()))
        entries = np.bincount(owner, charged[W.indices], len(form.c))
        self._price = dict[int, float]()
        for i in self._need:
            self._toll[group == group[i]] = 0.0
            self._toll[blocked[i]] = dear
            excess = dear * entries[blocked[i]] - form.c[blocked[i]]
            self._price[i] = float(form.c[i] + excess.max(initial=0.0))
        self._group = group

    @property
    def needed(self) -> list[int]:
        """The rows that need such candidates."""
        return sorted(set(self._need.values()))

    def parts(self, scale: int) -> list[Part]:
        """The rows that need such candidates, each a part of its own."""
        whole, found = self._whole, []
        for j in self.needed:
            entries = np.flatnonzero(whole.W.indices == j)
            owner = whole.owner[entries]
            charge = np.where(np.isnan(self._toll[owner]), 0.0, self._toll[owner])
            # Candidates of no further use: what else they cover is met by those that every plan has.
            lost = (whole.reduced.stand_in[owner] < 0) & np.isnan(self._toll[owner])
            charge[lost] = whole.form.c[owner[lost]]
            for i, row in self._need.items():
                same = (self._group[owner] == self._group[i]) & (self._toll[owner] == 0.0)
                charge[same] = self._price[i] if row == j else 0.0
            paid = np.floor(charge * scale).astype(np.int64)
            sweep = Sweep(entry=paid, order=np.array([j]), limit=None)
            found.append(Part(elements=np.array([j]), charged=owner, charge=paid, proof=sweep))
        return found

    def charges(self, entries: LongArray) -> tuple[LongArray, FloatArray]:
        """Of a part with some entries: candidates that it charges in its own way, and how much."""
        owner = self._whole.owner[entries]
        charged, count = np.unique(owner[~np.isnan(self._toll[owner])], return_counts=True)
        return charged, self._toll[charged] * count


def _needs(W: csc_array, owner: LongArray, group: LongArray, blocked: dict[int, LongArray]) -> dict[int, int]:
    """The row that needs each candidate of every plan; what is blocked but would do as well is blocked no longer."""
    while True:
        out = np.isin(np.arange(len(group)), np.concatenate(list(blocked.values())))
        need, wrong = {}, []
        for i, others in blocked.items():
            need[i], missing = _neediest(W, owner, np.where(out, -1, group), group[i], i)
            if len(others) and missing <= _in_row(W, need[i])[others].max() + 1e-9:
                wrong.append(i)
        for i in wrong:
            blocked[i] = blocked[i][:0]
        if not wrong:
            return need


def _replaced(W: csc_array, peers: LongArray, i: int, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which peers candidate i replaces, itself among them: it is at least as large in all rows that are kept."""
    most = np.zeros(W.shape[0])
    most[W.indices[W.indptr[i] : W.indptr[i + 1]]] = W.data[W.indptr[i] : W.indptr[i + 1]]
    part = csc_array(W[:, peers])
    larger = kept[part.indices] & (part.data > most[part.indices])
    return ~np.isin(np.arange(len(peers)), np.repeat(np.arange(len(peers)), np.diff(part.indptr))[larger])


def _in_row(W: csc_array, j: int) -> FloatArray:
    """The entries of a row, one a candidate."""
    entry = np.zeros(W.shape[1])
    spots = np.flatnonzero(W.indices == j)
    entry[np.searchsorted(W.indptr, spots, side="right") - 1] = W.data[spots]
    return entry


def _home(form: CoverForm) -> LongArray:
    """The group of each candidate: the largest of its packing rows, or itself."""
    P = form.P
    sizes = np.diff(P.indptr)
    row = np.repeat(np.arange(P.shape[0]), sizes)
    order = np.argsort(sizes[row], kind="stable")
    group = np.arange(P.shape[0], P.shape[0] + P.shape[1])
    group[P.indices[order]] = row[order]
    return group


def _neediest(W: csc_array, owner: LongArray, group: LongArray, own: int, i: int) -> tuple[int, float]:
    """The row of candidate i that other groups than its own leave most to, and how much; -1 is no group."""
    rows = W.indices[W.indptr[i] : W.indptr[i + 1]]
    found, missing = -1, -np.inf
    for j in rows.tolist():
        spots = np.flatnonzero((W.indices == j) & (group[owner] != own) & (group[owner] >= 0))
        most = np.zeros(int(group.max()) + 1)
        np.maximum.at(most, group[owner[spots]], W.data[spots])
        if 1.0 - most.sum() > missing:
            found, missing = j, 1.0 - float(most.sum())
    return found, missing

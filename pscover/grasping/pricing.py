"""What the covering rows are worth when every pose may be chosen: the linear relaxation by column generation.

**The bound.** For all multipliers y >= 0 of rows sum_i w_ij x_i >= r_j that every plan meets, every plan costs at least

    L(y) = sum_j y_j r_j + sum over parts of min(0, least reduced cost 1 - sum_j y_j w_ij in the part),

and every plan that holds pose i of part P at least L(y) - min(0, least of P) + (1 - sum_j y_j w_ij). A goal forgives what
is short by its tolerance, so r_j, the least that a plan brings to row j, is a hair below 1. All poses are priced for it, so
it holds over all of them, however few the relaxation was solved with (`pscover.grasping.columns`). Rows are those of the
garments, and rounded sums of them (`pscover.grasping.rounding`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pscover.grasping.all_poses import AllPoses, Over
from pscover.grasping.columns import WORTH, Columns, Relaxed, best_poses, relaxation
from pscover.grasping.relaxation import Basis
from pscover.grasping.rounding import Cut, violated, with_cuts

FloatArray = NDArray[np.float64]
ROUNDS = 60
"""Most relaxations solved; a handful is usual."""
SAFE = 1e-9
"""Relative margin for rounding in bounds."""
ROUGH = 1e-3
"""How near to the best the prices must be, relatively, before cuts are looked for."""
NEAR = 0.2
"""Poses of higher reduced cost are left out of the relaxation first, where cuts are looked for."""
HOPE = 10
"""Rounds like the last that may be needed to the next whole number; if it takes more, cuts are looked for no further."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prices:
    """Multipliers and what they prove.

    Parameters
    ----------
    poses
        Every pose, with its worth to the rows that are priced: the garments', and after them those of the cuts.
    cuts
        See `pscover.grasping.rounding`.
    multipliers
        y, shape (rows,).
    plain
        Multipliers of the garments' rows alone, shape (garments,).
    value
        L(y).
    least
        min(0, least reduced cost) of each part, shape (parts,).
    out_of_reach
        Whether some garment needs more than the best pose of every part together gives it: then there is no plan.
    columns
        The poses that the relaxation was solved with.
    """

    poses: AllPoses
    cuts: tuple[Cut, ...]
    multipliers: FloatArray
    plain: FloatArray
    value: float
    least: FloatArray
    out_of_reach: bool
    columns: Columns

    @property
    def bound(self) -> float:
        """No plan of poses on the grid has fewer grasps; infinite if there is none.

        There is none either if it would have more grasps than there are parts, of which each gives at most one.
        """
        return np.inf if self.out_of_reach or self.value > len(self.least) + WORTH else self.value

    def floors(self, part: int) -> FloatArray:
        """A plan that holds the pose costs at least so much, for each of the part's poses, shape (poses of the part,)."""
        reduced = 1.0 - self.multipliers[self.poses.garments[part]] @ self.poses.worth[part]
        floors: FloatArray = (self.value - self.least[part] + reduced) - SAFE * (1.0 + abs(self.value))
        return floors

    def ranks(self, part: int) -> FloatArray:
        """What speaks against each of the part's poses, shape (poses of the part,).

        Cuts count alike what is alike for them; of such poses those come first that the garments' rows alone favour.
        """
        garments = self.poses.garments[part]
        own = garments < len(self.plain)
        gains = self.plain[garments[own]] @ self.poses.worth[part][own]
        ranks: FloatArray = self.floors(part) + gains.max(initial=1.0) - gains
        return ranks


def price(poses: AllPoses, over: Over = lambda: False) -> Prices | None:
    """Multipliers near the best; None if it was over before there were any.

    Parameters
    ----------
    poses
        Every pose.
    over
        Asked from round to round whether to stop with the best multipliers so far.

    Examples
    --------
    >>> from pscover.grasping.all_poses import all_poses
    >>> from pscover.grasping.ellipse import Ellipse
    >>> from pscover.grasping.sampling import Sampling
    >>> from pscover.scene import Scene
    >>> scene = Scene.of(np.kron([[1, 0, 2]], np.ones((20, 60), dtype=int)))
    >>> prices = price(all_poses(scene, Sampling(), Ellipse(), np.array([0.7, 0.7])))
    >>> round(prices.bound, 3)
    2.0
    """
    nothing, columns = np.zeros(poses.rows), Columns.extremes(poses)
    start = Prices(
        poses=poses,
        cuts=(),
        multipliers=nothing,
        plain=nothing,
        value=0.0,
        least=np.zeros(poses.parts),
        out_of_reach=_is_out_of_reach(poses),
        columns=columns,
    )
    if not len(columns.part):
        return start
    settled = _settled(start, None, over)
    return None if settled is None else replace(settled.prices, plain=settled.prices.multipliers)


def tightened(prices: Prices, enough: float, over: Over = lambda: False) -> Prices:
    """Prices of more rows: of rounded sums of the garments', as the relaxation violates them.

    Parameters
    ----------
    prices
        Of the garments' rows.
    enough
        A bound that is not to be exceeded.
    over
        Asked from round to round whether to stop with the best prices so far.
    """
    given, best, cuts, rise = prices.poses, prices, prices.cuts, np.inf
    reduced = 1.0 - prices.multipliers @ prices.columns.worth - prices.least[prices.columns.part]
    begun = replace(prices, columns=prices.columns.where(reduced <= NEAR))
    settled = _settled(begun, None, over, ROUGH) if len(begun.columns.part) else None
    while settled is not None and settled.prices.bound <= enough and HOPE * rise > np.floor(best.value) + 1 - best.value:
        relaxed, columns = settled.relaxed, settled.prices.columns
        taken = relaxed.x > WORTH
        fresh = violated(columns.worth[: given.rows, taken], relaxed.x[taken], given.needed)
        if not fresh or over():
            break
        of_cuts = relaxed.y[given.rows :]
        basis = relaxed.basis and relaxed.basis.without(given.parts + len(given.wanted()) + np.flatnonzero(of_cuts <= WORTH))
        kept = tuple(cut for cut, y in zip(cuts, of_cuts, strict=True) if y > WORTH)
        cuts = kept + tuple(cut for cut in fresh if cut not in kept)
        poses = with_cuts(given, cuts)
        begun = replace(prices, poses=poses, cuts=cuts, value=-np.inf, columns=columns.over(poses))
        settled = _settled(begun, basis, over, ROUGH)
        if settled is not None:
            rise = settled.prices.value - best.value
            best = settled.prices if settled.prices.value > best.value else best
    return best


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Settled:
    """The best prices, and the last relaxation, over their columns."""

    prices: Prices
    relaxed: Relaxed


def _settled(start: Prices, basis: Basis | None, over: Over, slack: float = WORTH) -> _Settled | None:
    """Relax and price in turn until that can change next to nothing; None if there was no relaxation."""
    poses, best, columns, wanted = start.poses, start, start.columns, start.poses.wanted()
    settled: _Settled | None = None
    for _ in range(ROUNDS):
        relaxed = None if over() else relaxation(columns, wanted, poses.parts, basis)
        if relaxed is None:
            break
        dearest, gains = best_poses(poses, relaxed.y)
        proven = _proven(start, relaxed.y, columns, gains)
        best = proven if proven.value > best.value else best
        settled = _Settled(prices=replace(best, columns=columns), relaxed=relaxed)
        more = columns.joined(poses, dearest, gains > 1.0 + relaxed.z + WORTH)
        if more is None or proven.value > relaxed.value - slack * (1.0 + relaxed.value):
            break
        columns, basis = more, relaxed.basis
    return settled


def _is_out_of_reach(poses: AllPoses) -> bool:
    """Whether some garment that is under a pose is not covered by the best pose of every part together."""
    supply = np.zeros(poses.rows)
    for part in range(poses.parts):
        supply[poses.garments[part]] += poses.worth[part].max(axis=1, initial=0.0)
    wanted = poses.wanted()
    return bool((supply[wanted] < poses.needed[wanted] - SAFE).any())


def _proven(prices: Prices, y: FloatArray, columns: Columns, gains: FloatArray) -> Prices:
    """With other multipliers, from how much the best pose of each part is worth at them."""
    least = np.minimum(0.0, 1.0 - gains)
    value, size = float(y @ prices.poses.needed + least.sum()), float(y.sum() - least.sum())
    return replace(prices, multipliers=y, value=value - 1e-12 * size, least=least, columns=columns)

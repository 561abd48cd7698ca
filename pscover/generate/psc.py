"""Random instances of probabilistic set cover: on a random incidence, or on that of a set-cover problem.

Requirements are met by the candidates with room to spare: b_j = -log(1 - q_j) is capped at a share of what all candidates
together supply, sum_i -log(1 - p_ij). Conflicts are disjoint cliques, drawn at random; they may make an instance infeasible.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.cliques import Cliques
from pscover.errors import InvalidSettings
from pscover.instance import FloatArray, Instance, Meta

SUPPLY_SHARE = 0.8
"""A row demands at most this share of its supply."""


def random_psc(
    elements: int,
    candidates: int,
    *,
    covers: int = 4,
    low: float = 0.3,
    high: float = 0.95,
    required: float = 0.95,
    clique_size: int | None = None,
    cheapest: int = 1,
    dearest: int = 1,
    seed: int = 1,
) -> Instance:
    """A random instance in which every candidate covers the same number of elements.

    Parameters
    ----------
    elements, candidates
        The size.
    covers
        How many distinct elements each candidate covers, drawn uniformly.
    low, high
        p_ij is drawn uniformly from [low, high).
    required
        q_j of all elements, less where the supply is short.
    clique_size
        How many candidates exclude each other; None for no conflicts.
    cheapest, dearest
        Costs are whole numbers drawn uniformly from this range, both ends included.
    seed
        Of everything random.

    Returns
    -------
    Instance
        `meta.source` has the call that makes it again.

    Raises
    ------
    InvalidSettings
        If an argument is outside its domain.

    Examples
    --------
    >>> instance = random_psc(5, 12, covers=2, clique_size=3, seed=7)
    >>> instance.elements, instance.candidates, len(instance.conflicts)
    (5, 12, 4)
    >>> instance.meta.name
    'psc5x12-q95-c3'
    """
    _check("elements", elements, elements >= 1, "a whole number of at least 1")
    _check("candidates", candidates, candidates >= 1, "a whole number of at least 1")
    _check("covers", covers, 1 <= covers <= elements, f"a whole number from 1 to elements ({elements})")
    _check("cheapest, dearest", (cheapest, dearest), 1 <= cheapest <= dearest, "1 <= cheapest <= dearest")
    rng = _generator(seed)
    rows = _subsets(elements, candidates, covers, rng)
    starts = np.arange(candidates + 1) * covers
    incidence = csc_array((np.ones(rows.size), rows.ravel(), starts), shape=(elements, candidates))
    cost = rng.integers(cheapest, dearest, size=candidates, endpoint=True).astype(np.float64)
    source = (
        f"pscover.generate.psc.random_psc({elements}, {candidates}, covers={covers}, low={low}, high={high}, "
        f"required={required}, clique_size={clique_size}, cheapest={cheapest}, dearest={dearest}, seed={seed})"
    )
    name = f"psc{elements}x{candidates}{_suffix(required, clique_size)}"
    return _drawn(incidence, cost, (low, high), required, clique_size, rng, Meta(name=name, source=source))


def psc_on_incidence(
    instance: Instance,
    low: float = 0.3,
    high: float = 0.95,
    required: float = 0.95,
    clique_size: int | None = None,
    seed: int = 1,
) -> Instance:
    """An instance with the incidence and the costs of another, say of the OR-Library, and random probabilities.

    Parameters
    ----------
    instance
        Its incidence and costs are used, its conflicts are not.
    low, high
        p_ij is drawn uniformly from [low, high), in the order of the stored entries (by candidate, then by element).
    required
        q_j of all elements, less where the supply is short.
    clique_size
        All candidates are put into disjoint cliques of this size at random, the last one perhaps smaller; None for no
        conflicts.
    seed
        Of everything random.

    Raises
    ------
    InvalidSettings
        If an argument is outside its domain.

    Examples
    --------
    >>> cover = Instance.of([[1, 0, 1], [1, 1, 0]], required=0.5, meta=Meta(name="tiny"))
    >>> instance = psc_on_incidence(cover, required=0.7, clique_size=2)
    >>> instance.meta.name, instance.probability.nnz, len(instance.conflicts)
    ('tiny-q70-c2', 4, 1)
    """
    source = (
        f"pscover.generate.psc.psc_on_incidence({instance.meta.name or instance.digest}, low={low}, high={high}, "
        f"required={required}, clique_size={clique_size}, seed={seed})"
    )
    meta = Meta(
        name=f"{instance.meta.name or 'psc'}{_suffix(required, clique_size)}",
        source=source,
        elements=instance.meta.elements,
        candidates=instance.meta.candidates,
        poses=instance.meta.poses,
    )
    rng = _generator(seed)
    return _drawn(instance.probability, instance.cost, (low, high), required, clique_size, rng, meta)


def _generator(seed: int) -> np.random.Generator:
    _check("seed", seed, seed >= 0, "a whole number of at least 0")
    return np.random.default_rng(seed)


def _drawn(
    incidence: csc_array,
    cost: FloatArray,
    span: tuple[float, float],
    required: float,
    clique_size: int | None,
    rng: np.random.Generator,
    meta: Meta,
) -> Instance:
    _check("low, high", span, 0 < span[0] <= span[1] <= 1, "0 < low <= high <= 1")
    _check("required", required, 0 <= required < 1, "a number in [0, 1)")
    p = rng.uniform(*span, size=incidence.nnz)
    with np.errstate(divide="ignore"):
        supply = np.bincount(incidence.indices, weights=-np.log1p(-p), minlength=incidence.shape[0])
    q = np.minimum(required, -np.expm1(-SUPPLY_SHARE * supply))
    conflicts = Cliques.of() if clique_size is None else _disjoint_cliques(incidence.shape[1], clique_size, rng)
    probability = csc_array((p, incidence.indices, incidence.indptr), shape=incidence.shape)
    return Instance.of(probability, q, cost, conflicts, meta)


def _subsets(elements: int, candidates: int, size: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """A uniform subset of the elements for each candidate, shape (candidates, size).

    Floyd's algorithm (Bentley and Floyd 1987) for all candidates at once: each draw is from one element more than the last,
    and the newest element takes the place of a draw that was taken already.
    """
    drawn = np.empty((candidates, size), dtype=np.int64)
    for k in range(size):
        newest = elements - size + k
        draw = rng.integers(0, newest, size=candidates, endpoint=True)
        taken = (drawn[:, :k] == draw[:, None]).any(axis=1)
        drawn[:, k] = np.where(taken, newest, draw)
    return drawn


def _disjoint_cliques(candidates: int, size: int, rng: np.random.Generator) -> Cliques:
    """All candidates in random groups of `size`; what is left over is a smaller group, or free if it is one."""
    _check("clique_size", size, size >= 2, "a whole number of at least 2, or None")
    order = rng.permutation(candidates)
    starts = np.arange(0, candidates, size)
    if candidates - starts[-1] == 1:
        order, starts = order[:-1], starts[:-1]
    return Cliques.flat(np.append(starts, len(order)), order)


def _suffix(required: float, clique_size: int | None) -> str:
    digits = f"{required:.10g}".removeprefix("0.").ljust(2, "0")
    return f"-q{digits}" + ("" if clique_size is None else f"-c{clique_size}")


def _check(name: str, got: object, good: bool, expected: str) -> None:
    if not good:
        raise InvalidSettings(f"{name}: expected {expected}, got {got!r}")

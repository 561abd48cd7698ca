"""What proofs of lower bounds are made of; what each proves, and why, is said in `certificate`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidResult
from pscover.instance import Instance
from pscover.relaxation import HUGE
from pscover.sweeping import MOST_PRICED

LongArray = NDArray[np.int64]

MOST_DEPTH = 100
"""Splits and parts within each other; deeper certificates are refused."""
MOST_COUNT = 16
"""Candidates that a split counts at most: they are a dimension of the dynamic programme."""
MOST_DIVIDED = 2**28
"""Entries that parts divide, at each depth anew."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prices:
    """What elements pay: a bound of rows that are solved one by one.

    Parameters
    ----------
    entry
        What each element pays for each candidate, in 1/scale, shape (entries,): those of `Instance.probability` whose
        elements are in the part, or all, in its order.
    unit
        What each element of the part pays for a unit of its demand, in 1/scale, at least 0, shape (elements,).
    """

    entry: LongArray
    unit: LongArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sweep:
    """A bound of rows that are solved together.

    Parameters
    ----------
    entry
        As in `Prices`.
    order
        All elements of the part; groups are taken as their first element comes.
    limit
        The bound that is asked for, in 1/scale; None for whether there is any plan.
    """

    entry: LongArray
    order: LongArray
    limit: int | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Split:
    """Two sides: plans with at most `count` of the candidates of an element, and plans with more.

    Parameters
    ----------
    element
        Whose candidates are counted.
    count
        How many.
    few, many
        What proves the bound of each side.
    """

    element: int
    count: int
    few: Proof
    many: Proof


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """Some elements, and what is charged there for their candidates.

    Parameters
    ----------
    elements
        Which, rising.
    charged, charge
        Candidates that cover any of them, rising, and what is charged for each, in 1/scale; of others that is all that
        earlier parts have left of their costs.
    proof
        Of a bound on what is charged in all.
    """

    elements: LongArray
    charged: LongArray
    charge: LongArray
    proof: Proof


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Parts:
    """Elements divided: a bound that is the sum of those of its parts."""

    parts: tuple[Part, ...]


Proof = Prices | Sweep | Split | Parts


def check(proof: Proof, instance: Instance, units: int) -> None:
    """Raise InvalidResult if a proof is none for an instance of this size, or its numbers are too large."""
    every = np.diff(instance.probability.tocsr().indptr).astype(np.int64)
    stack: list[tuple[Proof, LongArray, int]] = [(proof, np.arange(instance.elements), 0)]
    charged, divided = 0.0, 0
    while stack:
        part, elements, depth = stack.pop()
        entries = int(every[elements].sum())
        if isinstance(part, Prices):
            _check_prices(part, every[elements], entries, units)
            continue
        if isinstance(part, Sweep):
            _check_sweep(part, elements, entries)
            continue
        if depth >= MOST_DEPTH:
            raise InvalidResult(f"certificate: expected at most {MOST_DEPTH} splits and parts within each other, got more")
        if isinstance(part, Split):
            _check_split(part, elements)
            stack += [(part.few, elements, depth + 1), (part.many, elements, depth + 1)]
        elif isinstance(part, Parts) and isinstance(part.parts, tuple) and part.parts:
            divided += entries + instance.candidates
            for one in part.parts:
                charged += _check_part(one, elements, instance.candidates)
                stack.append((one.proof, one.elements, depth + 1))
        else:
            raise InvalidResult(f"certificate: proof: expected Prices, a Sweep, a Split or Parts, got {_kind(part)}")
        if charged >= MOST_PRICED or divided > MOST_DIVIDED:
            raise InvalidResult("certificate: parts: expected charges that add up to less than 2^55, and fewer parts")


def _kind(given: object) -> str:
    return "no parts" if isinstance(given, Parts) else type(given).__name__


def _check_split(split: Split, elements: LongArray) -> None:
    whole = isinstance(split.element, int) and isinstance(split.count, int)
    if not (whole and 0 <= split.count <= MOST_COUNT and (elements == split.element).any()):
        expected = f"an element of its part and a count of at most {MOST_COUNT}"
        raise InvalidResult(f"certificate: split: expected {expected}, got {split.element!r} and {split.count!r}")


def _check_part(part: Part, elements: LongArray, candidates: int) -> float:
    """About how much it charges."""
    if not isinstance(part, Part):
        raise InvalidResult(f"certificate: parts: expected a Part, got {type(part).__name__}")
    _check_array("elements of a part", part.elements, None)
    _check_array("charged candidates", part.charged, None)
    _check_array("charges", part.charge, len(part.charged))
    place = np.minimum(np.searchsorted(elements, part.elements), len(elements) - 1)
    if not len(part.elements) or (elements[place] != part.elements).any() or (np.diff(part.elements) <= 0).any():
        raise InvalidResult("certificate: parts: expected elements of what is divided, rising strictly, got others")
    within = part.charged[(part.charged >= 0) & (part.charged < candidates)]
    if len(within) < len(part.charged) or (np.diff(part.charged) <= 0).any():
        raise InvalidResult(f"certificate: parts: expected charged candidates below {candidates}, rising, got others")
    return float(np.abs(part.charge.astype(np.float64)).sum())


def _check_sweep(sweep: Sweep, elements: LongArray, entries: int) -> None:
    _check_array("entry prices", sweep.entry, entries)
    _check_array("order of a sweep", sweep.order, len(elements))
    if not np.array_equal(np.sort(sweep.order), elements):
        raise InvalidResult("certificate: order of a sweep: expected every element of its part once, got others")
    if not (sweep.limit is None or (isinstance(sweep.limit, int) and abs(sweep.limit) <= HUGE)):
        raise InvalidResult(f"certificate: limit of a sweep: expected a whole number up to 2^59, got {sweep.limit!r}")
    if np.abs(sweep.entry.astype(np.float64)).sum() >= MOST_PRICED:
        raise InvalidResult("certificate: expected prices of a sweep that add up to less than 2^55, got larger ones")


def _check_prices(prices: Prices, held: LongArray, entries: int, units: int) -> None:
    _check_array("entry prices", prices.entry, entries)
    _check_array("unit prices", prices.unit, len(held))
    if (prices.unit < 0).any():
        raise InvalidResult(f"certificate: unit prices: expected numbers of at least 0, got {int(prices.unit.min())}")
    # Sums of doubles are off by a tiny part: far less than the factor between HUGE and what would overflow.
    entry, unit = np.abs(prices.entry.astype(np.float64)), prices.unit.astype(np.float64)
    if entry.sum() + units * (unit * (held + 1)).sum() >= HUGE:
        raise InvalidResult("certificate: expected prices that add up to less than 2^59, got larger ones")


def _check_array(name: str, array: Any, size: int | None) -> None:
    if not isinstance(array, np.ndarray):
        raise InvalidResult(f"certificate: {name}: expected a NumPy array, got {type(array).__name__}")
    if array.dtype != np.int64 or array.shape != (len(array) if size is None and array.ndim == 1 else size,):
        many = "" if size is None else f"{size} "
        raise InvalidResult(f"certificate: {name}: expected {many}whole numbers, got {array.shape} of {array.dtype}")

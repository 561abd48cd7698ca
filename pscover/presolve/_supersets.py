"""Which items are at least others in every coordinate: the search behind row and column dominance.

An item is a sparse non-negative vector. Item b is *over* item a when b >= a in every coordinate; then b has all of a's
coordinates, so it is listed under the one of a's coordinates that lists the fewest. Bit signatures of the supports
refuse most of the rest, and what is left is compared entry by entry.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ._sparse import FloatArray, IntArray, Mask, spread
from .change import Over

WORDS = 16
"""Most 64-bit words of a signature: exact for up to 1024 coordinates."""
LISTED = 512
"""Most items compared with one item, those of the largest sum first."""
SLICES = ((0, 32), (32, LISTED))
"""The first of these are looked at for all items before the rest are for those that nothing was found for."""
CHUNK = 1 << 19
"""Pairs looked at at a time."""
PATIENCE = 1 << 21
"""Pairs looked at before a search that finds too little is given up."""
YIELD = 1 / 2000
"""Fewer finds than this for each pair looked at are too little."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Items:
    """Sparse vectors, item after item: coordinates (sorted within an item) and values.

    Parameters
    ----------
    starts, coordinates, values
        As in CSC; item a is the slice from starts[a] to starts[a + 1].
    dimensions
        How many coordinates there are.
    """

    starts: NDArray[np.int32]
    coordinates: NDArray[np.int32]
    values: FloatArray
    dimensions: int

    def __len__(self) -> int:
        return len(self.starts) - 1

    @cached_property
    def owner(self) -> IntArray:
        """The item of each entry."""
        return np.repeat(np.arange(len(self)), np.diff(self.starts))

    @cached_property
    def sums(self) -> FloatArray:
        """The sum of each item's values."""
        sums: FloatArray = np.bincount(self.owner, self.values, len(self)).astype(np.float64)
        return sums

    @cached_property
    def keys(self) -> IntArray:
        """One number for each entry, rising: its item, then its coordinate."""
        keys: IntArray = self.owner * self.dimensions + self.coordinates
        return keys

    @cached_property
    def exact(self) -> bool:
        """Whether signatures decide alone: every coordinate has its own bit and every value is 1."""
        return self.dimensions <= 64 * WORDS and bool((self.values == 1).all())

    @cached_property
    def signatures(self) -> NDArray[np.uint64]:
        """Bits of the supports, shape (words, items): a subset's bits are a subset.

        The first word mixes all coordinates and refuses most pairs; the others hold a range of coordinates each.
        """
        words = min(WORDS, max(1, -(-self.dimensions // 64)))
        signature = np.zeros((words, len(self)), dtype=np.uint64)
        some = np.flatnonzero(np.diff(self.starts))
        if not len(some):
            return signature
        where = self.coordinates.astype(np.int64)
        exact = self.dimensions <= 64 * words
        word = where >> 6 if exact else where * words // self.dimensions
        owner = self.owner
        starts = np.flatnonzero((np.diff(owner, prepend=-1) > 0) | (np.diff(word, prepend=-1) != 0))
        signature[word[starts], owner[starts]] = np.bitwise_or.reduceat(_bit(where & 63), starts)
        if words == 1 and exact:
            return signature
        mixed = np.zeros((1, len(self)), dtype=np.uint64)
        mixed[0, some] = np.bitwise_or.reduceat(_bit((where * 2654435761 >> 13) & 63), self.starts[some])
        return np.concatenate((mixed, signature))


def _bit(place: IntArray) -> NDArray[np.uint64]:
    return np.left_shift(np.uint64(1), place.astype(np.uint64))


class Lookup:
    """Compares items entry by entry.

    Parameters
    ----------
    items
        The vectors.
    """

    def __init__(self, items: Items) -> None:
        self.items = items
        self.keys = items.keys

    def values_at(self, item: IntArray, coordinate: IntArray) -> FloatArray:
        """Values, 0 where the item lacks the coordinate."""
        if not len(self.keys):
            return np.zeros(len(item))
        key = item * self.items.dimensions + coordinate
        at = np.minimum(np.searchsorted(self.keys, key), len(self.keys) - 1)
        return np.where(self.keys[at] == key, self.items.values[at], 0.0)

    def confirm(self, inner: IntArray, outer: IntArray) -> Mask:
        """For pairs of items whether outer is over inner; three entries are looked at before all of them."""
        good = np.ones(len(inner), dtype=np.bool_)
        sizes = np.diff(self.items.starts)
        for share in (2, 3, 5):
            left = np.flatnonzero(good & (sizes[inner] > 0))
            a = inner[left]
            spot = self.items.starts[a] + sizes[a] // share
            spot -= sizes[a] == sizes[a] // share
            there = self.values_at(outer[left], self.items.coordinates[spot].astype(np.int64))
            good[left[there < self.items.values[spot]]] = False
        left = np.flatnonzero(good)
        pair, spots, values = self.entries(inner[left], outer[left])
        good[left[pair[values < self.items.values[spots]]]] = False
        return good

    def entries(self, inner: IntArray, outer: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
        """All entries of the inner items of some pairs: which pair, which entry, the outer's value there."""
        begin = self.items.starts[inner]
        spots, pair = spread(begin, self.items.starts[inner + 1] - begin)
        return pair, spots, self.values_at(outer[pair], self.items.coordinates[spots].astype(np.int64))


class Effort:
    """Ends a search that finds too little for what it looks at."""

    def __init__(self) -> None:
        self.looked = 0
        self.found = 0

    def is_wasted(self) -> bool:
        """Whether to give up."""
        return self.looked > PATIENCE and self.found < YIELD * self.looked


def likely_pairs(
    items: Items, among: Mask, undecided: Mask, price: FloatArray, effort: Effort, over: Over
) -> Iterator[tuple[IntArray, IntArray]]:
    """Chunks of pairs (inner, outer) that contain all with outer over inner, but for the limits of effort.

    Within a chunk the pairs of an inner item are together, in the order of falling sums of outer, and
    price[outer] <= price[inner]. Items with the fewest pairs come first.

    Parameters
    ----------
    items
        The vectors.
    among
        Which items may be outer.
    undecided
        For which inner items pairs are wanted; the caller takes out those it is done with.
    price
        A further coordinate in which outer must be at most inner.
    effort
        What was looked at is added to it; the caller adds what it found.
    over
        Whether to stop.
    """
    nonempty = np.flatnonzero(np.diff(items.starts) > 0)
    if not len(nonempty):
        return
    bits = items.signatures
    listed, begin, count = _lists(items, among)
    coordinate, owner = items.coordinates, items.owner
    least = np.minimum.reduceat(count, items.starts[:-1][nonempty])
    holder = np.flatnonzero(count == np.repeat(least, np.diff(items.starts)[nonempty]))
    pivot = coordinate[holder[np.diff(owner[holder], prepend=-1) > 0]]
    order = np.argsort(least, kind="stable")
    inner, start, counts = nonempty[order], begin[pivot[order]], least[order]
    for first, last in SLICES:
        some = (counts > first) & undecided[inner]
        a, begin = inner[some], start[some] + first
        size = np.minimum(counts[some], last) - first
        edges = np.searchsorted(np.cumsum(size), np.arange(0, size.sum(), CHUNK))
        for low, high in pairwise(np.unique(np.append(edges, len(a))).tolist()):
            if over() or effort.is_wasted():
                return
            spots, at = spread(begin[low:high], size[low:high])
            effort.looked += len(at)
            yield _unrefused(a[low:high][at], listed[spots], bits, price)


def _unrefused(a: IntArray, b: IntArray, bits: NDArray[np.uint64], price: FloatArray) -> tuple[IntArray, IntArray]:
    """The pairs that neither signatures nor prices refuse."""
    for word in bits:
        good = np.flatnonzero((word[a] & ~word[b]) == 0)
        a, b = a[good], b[good]
    good = np.flatnonzero((a != b) & (price[b] <= price[a]))
    return a[good], b[good]


def _lists(items: Items, among: Mask) -> tuple[IntArray, IntArray, IntArray]:
    """The items of each coordinate by falling sum, where each list begins, and for each entry of an item how long the
    part of its coordinate's list is that has at least the item's sum."""
    n = len(items)
    owner, sums = items.owner, items.sums
    falling = np.argsort(-sums, kind="stable")
    rank = np.empty(n, dtype=np.int64)
    rank[falling] = np.cumsum(np.diff(sums[falling], prepend=np.inf) < 0)
    coordinate = items.coordinates.astype(np.int64)
    keys = coordinate * (n + 2) + rank[owner]
    inside = np.flatnonzero(among[owner])
    inside = inside[np.argsort(keys[inside], kind="stable")]
    listed = keys[inside]
    begin = np.searchsorted(listed, np.arange(items.dimensions) * (n + 2))
    if len(inside) == len(owner):
        # Every entry is in the lists: its place, moved to the last of equal sums, is where the part ends.
        place = np.empty(len(owner), dtype=np.int64)
        last = np.append(np.flatnonzero(np.diff(listed)), len(listed) - 1)
        place[inside] = np.repeat(last + 1, np.diff(last, prepend=-1))
        end = place
    else:
        end = np.searchsorted(listed, keys, side="right")
    return owner[inside], begin, end - begin[coordinate]


def first_of_each(inner: IntArray, most: int) -> Mask:
    """Which pairs, those of an inner item together, are among the first `most` of their inner item."""
    start = np.maximum.accumulate(np.where(np.diff(inner, prepend=-1) != 0, np.arange(len(inner)), 0))
    first: Mask = np.arange(len(inner)) - start < most
    return first

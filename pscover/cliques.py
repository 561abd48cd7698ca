"""Cliques of conflicts: groups of candidates of which at most one may be chosen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from pscover.errors import InvalidInstance

IntArray = NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Cliques:
    """A list of cliques, stored flat and read-only; clique k is `members[starts[k]:starts[k + 1]]`, sorted.

    Examples
    --------
    >>> cliques = Cliques.of([(2, 0), (1, 2, 3)])
    >>> len(cliques), cliques[0].tolist()
    (2, [0, 2])
    >>> cliques.pairs().tolist()
    [[0, 2], [1, 2], [1, 3], [2, 3]]
    """

    starts: IntArray
    members: IntArray

    @classmethod
    def of(cls, groups: Iterable[Iterable[int]] = ()) -> Cliques:
        """Cliques from groups of candidate indices, each of at least two distinct members.

        Raises
        ------
        InvalidInstance
            If a group has fewer than two members, repeats one, or holds something that is no index.
        """
        listed = []
        if not isinstance(groups, Iterable):
            raise InvalidInstance(f"conflicts: expected a list of lists of candidate indices, got {groups!r}")
        for k, group in enumerate(groups):
            try:
                clique = np.asarray(group if isinstance(group, np.ndarray) else list(group))
            except TypeError:
                raise InvalidInstance(f"conflicts[{k}]: expected a list of candidate indices, got {group!r}") from None
            if clique.ndim != 1 or clique.dtype.kind not in "iu" or len(clique) < 2:
                raise InvalidInstance(f"conflicts[{k}]: expected at least two candidate indices, got {clique.tolist()}")
            listed.append(clique)
        sizes = [len(clique) for clique in listed]
        starts = np.concatenate(([0], np.cumsum(sizes, dtype=np.int64)))
        members = np.concatenate(listed).astype(np.int64) if listed else np.zeros(0, dtype=np.int64)
        return cls.flat(starts, members)

    @classmethod
    def flat(cls, starts: ArrayLike, members: ArrayLike) -> Cliques:
        """Cliques from the flat form: checked, sorted within each clique, copied and frozen."""
        begin = np.array(starts, dtype=np.int64)
        flat = np.array(members, dtype=np.int64)
        if begin.ndim != 1 or flat.ndim != 1 or len(begin) == 0 or begin[0] != 0 or begin[-1] != len(flat):
            raise InvalidInstance("conflicts: starts must run from 0 to the number of members")
        sizes = np.diff(begin)
        if (sizes < 2).any():
            k = int(np.flatnonzero(sizes < 2)[0])
            raise InvalidInstance(f"conflicts[{k}]: expected at least two candidate indices, got {max(0, int(sizes[k]))}")
        owner = np.repeat(np.arange(len(sizes)), sizes)
        flat = flat[np.lexsort((flat, owner))]
        twice = np.flatnonzero((flat[1:] == flat[:-1]) & (owner[1:] == owner[:-1]))
        if len(twice):
            raise InvalidInstance(f"conflicts[{owner[twice[0]]}]: candidate {flat[twice[0]]} is given twice")
        if len(flat) and (flat.min() < 0 or flat.max() >= 2**31 - 1):
            raise InvalidInstance(f"conflicts: expected indices from 0 on, got {int(flat.min())}, {int(flat.max())}")
        frozen = cls(begin.astype(np.int32), flat.astype(np.int32))
        frozen.starts.setflags(write=False)
        frozen.members.setflags(write=False)
        return frozen

    def check(self, candidates: int) -> None:
        """Raise `InvalidInstance` if a member is not below the number of candidates."""
        bad = np.flatnonzero(self.members >= candidates)
        if len(bad):
            place = int(self.owner()[bad[0]])
            got = int(self.members[bad[0]])
            raise InvalidInstance(f"conflicts[{place}]: expected candidate indices below {candidates}, got {got}")

    def __len__(self) -> int:
        return len(self.starts) - 1

    def __getitem__(self, k: int) -> IntArray:
        if not -len(self) <= k < len(self):
            raise IndexError(f"clique {k} of {len(self)}")
        k %= len(self)
        return self.members[self.starts[k] : self.starts[k + 1]]

    def __iter__(self) -> Iterator[IntArray]:
        return (self[k] for k in range(len(self)))

    def owner(self) -> IntArray:
        """The clique of each entry of `members`."""
        return np.repeat(np.arange(len(self), dtype=np.int32), np.diff(self.starts))

    def matrix(self, candidates: int) -> csr_array:
        """Membership as a sparse matrix of ones, shape (cliques, candidates)."""
        ones = np.ones(len(self.members))
        return csr_array((ones, self.members.copy(), self.starts.copy()), shape=(len(self), candidates))

    def broken_by(self, chosen: ArrayLike | list[int]) -> IntArray:
        """The cliques of which more than one member is chosen."""
        counted = np.bincount(self.owner()[np.isin(self.members, np.asarray(chosen))], minlength=len(self))
        return np.flatnonzero(counted > 1).astype(np.int32)

    def pair_count(self) -> int:
        """An upper bound on the number of conflicting pairs: pairs counted once a clique."""
        sizes = np.diff(self.starts).astype(np.int64)
        return int((sizes * (sizes - 1) // 2).sum())

    def pairs(self) -> NDArray[np.int32]:
        """All conflicting pairs i < k once, sorted, shape (pairs, 2)."""
        sizes = np.diff(self.starts)
        found: list[NDArray[Any]] = []
        for size in np.unique(sizes):
            rows = self.starts[:-1][sizes == size]
            block = self.members[rows[:, None] + np.arange(size)]
            first, second = np.triu_indices(size, k=1)
            found.append(np.stack((block[:, first].ravel(), block[:, second].ravel()), axis=1))
        if not found:
            return np.zeros((0, 2), dtype=np.int32)
        keys = np.concatenate(found).astype(np.int64)
        unique = np.unique(keys[:, 0] << 32 | keys[:, 1])
        return np.stack((unique >> 32, unique & 0xFFFFFFFF), axis=1).astype(np.int32)


def merge_edges(edges: ArrayLike) -> Cliques:
    """Few maximal cliques that contain exactly the given pairs: a greedy edge clique cover.

    Clique by clique: start from the smallest pair not yet covered, and add, while there is one, the smallest common
    neighbour, those with an uncovered pair to the first member before the others. Deterministic, and independent of the
    order of the pairs. Finding the fewest cliques is NP-hard (Orlin 1977; Kou, Stockmeyer, Wong 1978).

    Parameters
    ----------
    edges
        Conflicting pairs of candidate indices, shape (pairs, 2), in any order; repeated pairs count once.

    Returns
    -------
    Cliques
        With `cliques.pairs()` equal to the given pairs, each clique maximal in their graph.

    Raises
    ------
    InvalidInstance
        If the pairs are no indices, or one joins a candidate to itself.

    Examples
    --------
    >>> [clique.tolist() for clique in merge_edges([(0, 1), (2, 0), (1, 2), (2, 3)])]
    [[0, 1, 2], [2, 3]]
    """
    pairs = np.asarray(edges)
    if pairs.size == 0:
        return Cliques.of()
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu" or pairs.min() < 0:
        raise InvalidInstance(f"conflicts: expected pairs of candidate indices, shape (pairs, 2), got {pairs.shape}")
    loops = np.flatnonzero(pairs[:, 0] == pairs[:, 1])
    if len(loops):
        raise InvalidInstance(f"conflicts[{loops[0]}]: candidate {pairs[loops[0], 0]} conflicts with itself")
    neighbours = _neighbours(pairs)
    uncovered = {first: {second for second in others if second > first} for first, others in neighbours.items()}
    found = []
    for first in sorted(neighbours):
        while uncovered[first]:
            clique = _grow(first, neighbours, uncovered[first])
            for member in clique:
                uncovered[member].difference_update(clique)
            found.append(sorted(clique))
    return Cliques.of(found)


def _neighbours(pairs: NDArray[Any]) -> dict[int, set[int]]:
    both = np.concatenate((pairs, pairs[:, ::-1])).astype(np.int64)
    both = both[np.argsort(both[:, 0], kind="stable")]
    vertices, begin = np.unique(both[:, 0], return_index=True)
    groups = np.split(both[:, 1], begin[1:])
    return {vertex: set(group.tolist()) for vertex, group in zip(vertices.tolist(), groups, strict=True)}


def _grow(first: int, neighbours: dict[int, set[int]], uncovered: set[int]) -> list[int]:
    """A maximal clique that contains `first` and as many of its uncovered neighbours as come easily."""
    clique = [first]
    common, wanted = neighbours[first], uncovered
    while common:
        member = min(wanted) if wanted else min(common)
        clique.append(member)
        wanted = wanted & neighbours[member]
        common = common & neighbours[member]
    return clique

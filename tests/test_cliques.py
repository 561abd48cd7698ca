"""Cliques, flat and as pairs."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pscover import InvalidInstance
from pscover.cliques import Cliques

groups = st.lists(st.lists(st.integers(0, 12), min_size=2, max_size=5, unique=True), max_size=6)


@given(groups)
def test_pairs_are_all_pairs_of_all_cliques_once(listed: list[list[int]]) -> None:
    expected = {pair for group in listed for pair in itertools.combinations(sorted(group), 2)}
    assert [tuple(pair) for pair in Cliques.of(listed).pairs().tolist()] == sorted(expected)


@given(groups, st.sets(st.integers(0, 12)))
def test_broken_by_counts_members(listed: list[list[int]], chosen: set[int]) -> None:
    expected = [k for k, group in enumerate(listed) if len(chosen & set(group)) > 1]
    assert Cliques.of(listed).broken_by(sorted(chosen)).tolist() == expected


def test_is_a_list_of_sorted_cliques() -> None:
    cliques = Cliques.of([[3, 1], np.array([0, 2, 4])])
    assert [clique.tolist() for clique in cliques] == [[1, 3], [0, 2, 4]]
    assert cliques[-1].tolist() == [0, 2, 4]
    assert cliques.matrix(5).toarray().tolist() == [[0, 1, 0, 1, 0], [1, 0, 1, 0, 1]]
    with pytest.raises(IndexError):
        cliques[2]


def test_flat_form_is_checked() -> None:
    with pytest.raises(InvalidInstance, match="starts must run from 0"):
        Cliques.flat([0, 3], [1, 2])
    with pytest.raises(InvalidInstance, match=r"conflicts\[1\]"):
        Cliques.flat([0, 2, 1, 3], [1, 2, 3])

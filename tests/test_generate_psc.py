"""Random instances: of the shape asked for, the same for the same seed, uniform, and reproducible from their source."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from pscover import Instance, InvalidSettings, Meta
from pscover.generate.psc import SUPPLY_SHARE, _subsets, psc_on_incidence, random_psc


def test_what_was_asked_for() -> None:
    instance = random_psc(30, 200, covers=5, low=0.4, high=0.6, required=0.9, clique_size=7, cheapest=2, dearest=9, seed=3)
    p = instance.probability
    assert p.shape == (30, 200)
    assert set(np.diff(p.indptr)) == {5}
    assert 0.4 <= p.data.min() < 0.41
    assert 0.59 < p.data.max() < 0.6
    assert set(instance.cost) == set(range(2, 10))
    assert [len(clique) for clique in instance.conflicts] == [7] * 28 + [4]
    assert sorted(instance.conflicts.members) == list(range(200))
    assert instance.required.max() == 0.9


def test_a_left_over_candidate_is_free() -> None:
    instance = random_psc(3, 7, covers=2, clique_size=3)
    assert [len(clique) for clique in instance.conflicts] == [3, 3]
    assert len(random_psc(3, 1, covers=2, clique_size=3).conflicts) == 0
    assert len(random_psc(3, 7, covers=2).conflicts) == 0


def test_the_seed_and_every_argument_matter() -> None:
    changes: list[dict[str, float | int]] = [
        {},
        {"seed": 2},
        {"covers": 3},
        {"low": 0.2},
        {"required": 0.5},
        {"clique_size": 4},
        {"dearest": 5},
    ]
    digests = [random_psc(8, 20, **change).digest for change in changes]  # type: ignore[arg-type]
    assert len(set(digests)) == len(digests)
    assert random_psc(8, 20).digest == digests[0]


def test_the_source_makes_the_instance_again() -> None:
    instance = random_psc(6, 15, covers=2, clique_size=4, dearest=3, seed=11)
    module, call = instance.meta.source.rsplit(".random_psc", 1)
    assert module == "pscover.generate.psc"
    assert eval(f"random_psc{call}").digest == instance.digest  # noqa: S307


def test_subsets_are_distinct_and_uniform() -> None:
    drawn = np.sort(_subsets(5, 20_000, 3, np.random.default_rng(1)), axis=1)
    subsets, counts = np.unique(drawn, axis=0, return_counts=True)
    assert subsets.tolist() == [list(subset) for subset in combinations(range(5), 3)]
    # Ten subsets of 2000 expected each: five standard deviations are 212.
    assert abs(counts - 2000).max() < 212
    assert sorted(_subsets(6, 1, 6, np.random.default_rng(2))[0]) == list(range(6))


def test_requirements_are_capped_at_the_supply() -> None:
    cover = Instance.of(
        np.array([[1.0, 0, 0, 0], [1, 1, 1, 1], [0, 0, 0, 0]]), required=0.5, cost=[1, 2, 3, 4], meta=Meta(name="c")
    )
    instance = psc_on_incidence(cover, required=0.99, seed=5)
    supply = -np.log1p(-instance.probability.toarray()).sum(axis=1)
    expected = np.minimum(0.99, 1 - np.exp(-SUPPLY_SHARE * supply))
    assert instance.required == pytest.approx(expected, abs=1e-12)
    assert instance.required[2] == 0
    assert (instance.coverage(range(4)) >= instance.required).all()
    assert instance.probability.indices.tolist() == cover.probability.indices.tolist()
    assert instance.cost.tolist() == [1, 2, 3, 4]
    assert instance.meta.name == "c-q99"
    assert instance.meta.source == (
        "pscover.generate.psc.psc_on_incidence(c, low=0.3, high=0.95, required=0.99, clique_size=None, seed=5)"
    )


def test_certain_candidates_are_allowed() -> None:
    instance = random_psc(3, 4, covers=2, low=1.0, high=1.0)
    assert (instance.probability.data == 1).all()
    assert set(instance.required) <= {0.0, 0.95}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"elements": 0}, "elements: expected a whole number of at least 1, got 0"),
        ({"candidates": 0}, "candidates: expected"),
        ({"covers": 4}, r"covers: expected a whole number from 1 to elements \(3\), got 4"),
        ({"covers": 0}, "covers: expected"),
        ({"low": 0.0}, "0 < low <= high <= 1"),
        ({"low": 0.8, "high": 0.7}, "0 < low <= high <= 1"),
        ({"high": float("nan")}, "0 < low <= high <= 1"),
        ({"required": 1.0}, "required: expected"),
        ({"clique_size": 1}, "clique_size: expected"),
        ({"cheapest": 0}, "1 <= cheapest <= dearest"),
        ({"cheapest": 3, "dearest": 2}, "1 <= cheapest <= dearest"),
        ({"seed": -1}, "seed: expected a whole number of at least 0, got -1"),
    ],
)
def test_arguments_outside_their_domain(arguments: dict[str, int], message: str) -> None:
    with pytest.raises(InvalidSettings, match=message):
        random_psc(**{"elements": 3, "candidates": 5, "covers": 2, **arguments})

"""The one door: what goes in comes out frozen, canonical and checked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_array, csr_array

from pscover import Instance, InvalidInstance, Meta


def test_buffers_are_private_and_read_only() -> None:
    p = np.array([[0.5, 0.25]])
    q = np.array([0.6])
    instance = Instance.of(p, q)
    p[0, 0] = q[0] = 0.9
    assert instance.probability.toarray().tolist() == [[0.5, 0.25]]
    assert instance.required.tolist() == [0.6]
    for buffer in (instance.probability.data, instance.probability.indices, instance.required, instance.cost):
        with pytest.raises(ValueError, match="read-only"):
            buffer[0] = 1


def test_any_layout_gives_the_same_digest() -> None:
    dense = np.array([[0.0, 0.5, 0.25], [0.75, 0.0, 1.0]])
    unsorted = coo_array(([1.0, 0.75, 0.5, 0.25], ([1, 1, 0, 0], [2, 0, 1, 2])), shape=(2, 3))
    digests = {Instance.of(form, 0.7).digest for form in (dense, csr_array(dense), unsorted)}
    assert len(digests) == 1
    assert Instance.of(dense, 0.8).digest not in digests


def test_digest_depends_on_every_part_of_the_problem_and_not_on_names() -> None:
    base: dict[str, Any] = {"probability": [[0.5, 0.5]], "required": 0.7, "cost": 1.0, "conflicts": ()}
    changes: list[dict[str, Any]] = [
        {"probability": [[0.5, 0.25]]},
        {"required": 0.6},
        {"cost": [1, 2]},
        {"conflicts": [(0, 1)]},
        {"probability": [[0.5, 0.5], [0, 0]]},
    ]
    digests = {Instance.of(**{**base, **change}).digest for change in ({}, *changes)}
    assert len(digests) == 6
    assert Instance.of(**base, meta=Meta(name="other")).digest in digests


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"probability": [[np.nan, 0.5]]}, r"element 0, candidate 0: expected a number in \(0, 1\], got nan"),
        ({"probability": [[0.5, -0.1]]}, r"element 0, candidate 1: expected a number in \(0, 1\], got -0.1"),
        ({"probability": [[0.5, 1.5]]}, r"got 1.5"),
        ({"probability": coo_array(([0.5, 0.5], ([0, 0], [1, 1])), shape=(1, 2))}, "given twice"),
        ({"probability": csr_array(([0.0], [1], [0, 1]), shape=(1, 2))}, "candidate 1: expected .* got 0.0"),
        ({"probability": [0.5, 0.5]}, r"expected shape \(elements, candidates\), got \(2,\)"),
        ({"probability": [["a", "b"]]}, "expected numbers"),
        ({"probability": np.array([[0.5 + 1j]])}, "expected plain real numbers"),
        ({"probability": np.ma.array([[0.5, 0.6]], mask=[[True, False]])}, "expected plain real numbers, got MaskedArray"),
        ({"probability": [[0.5], [0.5, 0.5]]}, "expected numbers of shape"),
        ({"probability": [[10**400]]}, "expected numbers of shape"),
        ({"cost": [10**400, 1]}, "cost: expected numbers"),
        ({"conflicts": 5}, "conflicts: expected a list of lists of candidate indices, got 5"),
        ({"meta": "name"}, "meta: expected a Meta, got str"),
        ({"required": 1.0}, r"required\[0\]: expected a number in \[0, 1\), got 1.0"),
        ({"required": float("nan")}, r"required\[0\]"),
        ({"required": [0.5, 0.5]}, r"required: expected shape \(1,\) or one number, got shape \(2,\)"),
        ({"cost": 0.0}, r"cost\[0\]: expected a positive finite number, got 0.0"),
        ({"cost": [1.0, float("inf")]}, r"cost\[1\]"),
        ({"conflicts": [(0,)]}, r"conflicts\[0\]: expected at least two"),
        ({"conflicts": [(0, 1), (1, 1)]}, r"conflicts\[1\]: candidate 1 is given twice"),
        ({"conflicts": [(0, 2)]}, r"conflicts\[0\]: expected candidate indices below 2, got 2"),
        ({"conflicts": [(0, -1)]}, "expected indices from 0 on"),
        ({"conflicts": [(0.0, 1.0)]}, r"conflicts\[0\]"),
        ({"conflicts": [3]}, r"conflicts\[0\]: expected a list of candidate indices"),
        ({"meta": Meta(elements=("a", "b"))}, "element names: expected 1, one each, got 2"),
        ({"meta": Meta(poses=np.zeros((1, 3)))}, r"poses: expected finite numbers of shape \(2, 3\)"),
    ],
)
def test_bad_data_are_named_with_their_place(change: dict[str, Any], message: str) -> None:
    data: dict[str, Any] = {"probability": [[0.5, 0.5]], "required": 0.7, **change}
    with pytest.raises(InvalidInstance, match=message):
        Instance.of(**data)


def test_coverage_is_one_minus_the_product_of_failures() -> None:
    rng = np.random.default_rng(3)
    p = rng.uniform(0.1, 1.0, (6, 9)) * (rng.random((6, 9)) < 0.5)
    chosen = [1, 4, 7]
    expected = 1 - np.prod(1 - p[:, chosen], axis=1)
    np.testing.assert_allclose(Instance.of(p).coverage(chosen), expected, atol=1e-15)
    assert Instance.of(p).coverage([]).tolist() == [0.0] * 6


def test_log_weights_and_truncation() -> None:
    instance = Instance.of([[0.5, 1.0, 0.9], [0.3, 0.0, 0.0]], required=[0.75, 0.0])
    assert instance.log_weights().toarray()[0, 1] == np.inf
    weights = instance.truncated_weights().toarray()
    np.testing.assert_allclose(weights[0], [0.5, 1.0, 1.0])
    assert weights[1].tolist() == [0, 0, 0]


@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (3, 0)])
def test_empty_instances_exist(shape: tuple[int, int]) -> None:
    instance = Instance.of(np.zeros(shape))
    assert (instance.elements, instance.candidates) == shape
    assert len(instance.coverage([])) == shape[0]

"""Reading a model as covering and packing rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from pscover import Refused
from pscover.model import Model, as_cover


def _model() -> Model:
    return Model(
        c=np.array([1.0, 2.0]),
        A=csr_array(np.array([[4.0, 1.0], [-1.0, -3.0], [1.0, 1.0]])),
        lo=np.array([2.0, -np.inf, -np.inf]),
        hi=np.array([np.inf, -2.0, 1.0]),
        ub=np.ones(2),
        integer=np.ones(2, dtype=bool),
        candidates=2,
    )


def test_rows_of_either_sign_are_scaled_and_truncated() -> None:
    form = as_cover(_model())
    assert form.W.toarray().tolist() == [[1.0, 0.5], [0.5, 1.0]]
    assert form.P.toarray().tolist() == [[1.0, 1.0]]
    assert form.allowed.tolist() == [True, True]


def test_what_is_no_cover_is_refused_with_a_reason() -> None:
    model = _model()
    signs = replace(model, A=csr_array(np.array([[4.0, -1.0], [-1.0, -3.0], [1.0, 1.0]])))
    cases = {
        "both signs": signs,
        "not binary": replace(model, integer=np.array([True, False])),
        "negative costs": replace(model, c=np.array([1.0, -1.0])),
        "order of priority": replace(model, then=(model.c,)),
        "both sides": replace(model, hi=np.array([3.0, -2.0, 1.0])),
        "negative capacity": replace(model, hi=np.array([np.inf, -2.0, -1.0])),
    }
    for reason, case in cases.items():
        with pytest.raises(Refused, match=reason):
            as_cover(case)


def test_a_variable_larger_than_a_packing_row_is_not_allowed() -> None:
    model = replace(_model(), A=csr_array(np.array([[4.0, 1.0], [-1.0, -3.0], [1.0, 2.0]])))
    assert as_cover(model).allowed.tolist() == [True, False]


def test_integral_cost() -> None:
    model = _model()
    assert model.is_integral_cost
    assert not replace(model, c=np.array([1.0, 0.5])).is_integral_cost
    assert not replace(model, integer=np.array([True, False])).is_integral_cost


def test_a_packing_row_without_capacity_forbids_its_variables() -> None:
    model = replace(
        _model(), A=csr_array(np.array([[4.0, 1.0], [-1.0, -3.0], [1.0, 0.0]])), hi=np.array([np.inf, -2.0, 0.0])
    )
    form = as_cover(model)
    assert form.allowed.tolist() == [False, True]
    assert form.P.shape == (0, 2)


def test_an_empty_row_that_must_be_positive_covers_nothing() -> None:
    model = replace(_model(), A=csr_array((3, 2)), hi=np.array([np.inf, -2.0, 0.0]))
    assert as_cover(model).W.toarray().tolist() == [[0.0, 0.0], [0.0, 0.0]]

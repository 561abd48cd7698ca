"""MPS files, read back by HiGHS: the same rows, columns, numbers and optimum."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import highspy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array

from pscover import Instance, PscoverError, Refused, registry
from pscover.generate.psc import random_psc
from pscover.io import write_mps
from pscover.io.mps import encode
from pscover.model import Model
from pscover.testing import instances


def model(**parts: Any) -> Model:
    """Minimise -3 x0 + 2 x1 + x2 + 10 over rows of every kind."""
    given_parts: dict[str, Any] = {
        "c": np.array([-3.0, 2.0, 1.0]),
        "A": csr_array(np.array([[1.0, 1, 1], [-1, 2, 0], [1, -1, 0.1], [0, 1, -1], [1, 1, 0]])),
        "lo": np.array([-np.inf, -1.5, 1.0, 0.0, -np.inf]),
        "hi": np.array([4.5, np.inf, 1.0, 2.5, np.inf]),
        "ub": np.array([3.0, np.inf, 0.75]),
        "integer": np.array([True, True, False]),
        "candidates": 2,
        "offset": 10.0,
    }
    return Model(**{**given_parts, **parts})


def read(text: str, folder: Path) -> highspy.Highs:
    (folder / "model.mps").write_text(text)
    highs = highspy.Highs()
    highs.setOptionValue("output_flag", False)
    assert highs.readModel(str(folder / "model.mps")) == highspy.HighsStatus.kOk
    return highs


def solved(highs: highspy.Highs) -> tuple[float, list[float]]:
    highs.run()
    assert highs.getModelStatus() == highspy.HighsModelStatus.kOptimal
    return highs.getInfo().objective_function_value, list(highs.getSolution().col_value)


def test_every_number_comes_back(tmp_path: Path) -> None:
    written = model()
    lp = read(encode(written), tmp_path).getLp()
    assert lp.offset_ == 10.0
    assert list(lp.col_cost_) == written.c.tolist()
    assert list(lp.col_lower_) == [0, 0, 0]
    assert list(lp.col_upper_) == written.ub.tolist()
    assert [kind == highspy.HighsVarType.kInteger for kind in lp.integrality_] == written.integer.tolist()
    assert list(lp.row_lower_) == written.lo.tolist()[:4]
    assert list(lp.row_upper_) == written.hi.tolist()[:4]
    assert list(lp.row_names_) == ["r0", "r1", "r2", "r3"]
    assert list(lp.col_names_) == ["x0", "x1", "x2"]


def test_the_optimum_comes_back_with_its_offset(tmp_path: Path) -> None:
    # x0 = x1 + 1 - 0.1 x2 with x2 <= 0.75 makes x2 = 0; x0 = 2, x1 = 1 costs -4, and x0 = 3, x1 = 2 breaks the first row.
    objective, point = solved(read(encode(model()), tmp_path))
    assert objective == pytest.approx(6.0, abs=1e-9)
    assert point == pytest.approx([2, 1, 0], abs=1e-9)


@pytest.mark.parametrize("name", registry.names("formulation"))
def test_formulations_have_the_same_optimum_after_the_round_trip(name: str, tmp_path: Path) -> None:
    instance = random_psc(6, 12, covers=3, required=0.45, clique_size=2, cheapest=1, dearest=9, seed=3)
    built = replace(registry.formulation(name).build(instance), then=())
    direct = highspy.Highs()
    direct.setOptionValue("output_flag", False)
    direct.passModel(as_lp(built))
    objective, point = solved(direct)
    again, other = solved(read(encode(built), tmp_path))
    assert again == pytest.approx(objective, abs=1e-9)
    assert float(built.c @ np.array(other)) == pytest.approx(float(built.c @ np.array(point)), abs=1e-9)


def as_lp(built: Model) -> highspy.HighsLp:
    lp = highspy.HighsLp()
    lp.num_col_, lp.num_row_, lp.offset_ = built.variables, built.rows, built.offset
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = built.c, np.zeros(built.variables), built.ub
    lp.row_lower_, lp.row_upper_ = built.lo, built.hi
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = built.A.indptr, built.A.indices, built.A.data
    lp.integrality_ = [
        highspy.HighsVarType.kInteger if whole else highspy.HighsVarType.kContinuous for whole in built.integer
    ]
    return lp


@settings(deadline=None, max_examples=60)
@given(instance=instances())
def test_coefficients_are_exact(instance: Instance) -> None:
    built = registry.formulation("clique").build(instance)
    numbers = {
        (row, column): float(value)
        for column, row, value in (
            line.split() for line in section(encode(built), "COLUMNS", "RHS") if "'MARKER'" not in line
        )
        if row != "cost"
    }
    entries = built.A.tocoo()
    expected = {(f"r{j}", f"x{i}"): v for j, i, v in zip(entries.row, entries.col, entries.data.tolist(), strict=True)}
    assert numbers == expected


def section(text: str, begin: str, end: str) -> list[str]:
    lines = text.splitlines()
    return lines[lines.index(begin) + 1 : lines.index(end)]


BOUNDS = st.floats(-1e6, 1e6) | st.sampled_from([0.1, 0.2, 0.3, 1 / 3, -0.7])


@settings(deadline=None, max_examples=60)
@given(bounds=st.tuples(BOUNDS, BOUNDS))
def test_two_sided_rows_keep_both_sides_exactly(bounds: tuple[float, float]) -> None:
    lo, hi = min(bounds), max(bounds)
    text = encode(model(lo=np.array([lo, *[-np.inf] * 4]), hi=np.array([hi, *[np.inf] * 4])))
    kinds = {name: kind for kind, name in (line.split() for line in section(text, "ROWS", "COLUMNS"))}
    rhs = {name: float(value) for _, name, value in (line.split() for line in section(text, "RHS", next_section(text)))}
    ranges = [line.split() for line in section(text, "RANGES", "BOUNDS")] if "RANGES" in text else []
    low, high = -math.inf, math.inf
    for name in ("r0", "r0u"):
        if name in kinds:
            side = rhs.get(name, 0.0)
            low = max(low, side) if kinds[name] in "GE" else low
            high = min(high, side) if kinds[name] in "LE" else high
    for _, _, width in ranges:
        low, high = (low, low + float(width)) if kinds["r0"] == "G" else (high - float(width), high)
    assert (low, high) == (lo, hi)


def next_section(text: str) -> str:
    return "RANGES" if "RANGES" in text.splitlines() else "BOUNDS"


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        ({"then": (np.zeros(3),)}, "several in order of priority"),
        ({"c": np.array([1.0, np.inf, 0.0])}, "coefficients that are not"),
        ({"offset": math.nan}, "coefficients that are not"),
        ({"lo": np.array([5.0, -1.5, 1, 0, -np.inf])}, r"row 0 has 5\.0 <= a x <= 4\.5"),
        ({"hi": np.array([4.5, np.inf, 1, np.nan, np.inf])}, r"row 3 has 0\.0 <= a x <= nan"),
        ({"ub": np.array([3.0, -1.0, 0.75])}, r"variable 1 has 0 <= x <= -1\.0"),
    ],
)
def test_models_that_mps_cannot_express(parts: dict[str, Any], reason: str, tmp_path: Path) -> None:
    with pytest.raises(Refused, match=reason):
        write_mps(model(**parts), tmp_path / "model.mps")
    assert list(tmp_path.iterdir()) == []


def test_variables_fixed_at_zero_and_a_model_without_rows(tmp_path: Path) -> None:
    fixed = model(ub=np.array([0.0, np.inf, 0.75]), A=csr_array((0, 3)), lo=np.zeros(0), hi=np.zeros(0))
    write_mps(fixed, tmp_path / "model.mps")
    lp = read((tmp_path / "model.mps").read_text(), tmp_path).getLp()
    assert list(lp.col_upper_) == [0.0, math.inf, 0.75]
    assert list(lp.col_lower_) == [0.0, 0.0, 0.0]


def test_a_folder_that_does_not_exist(tmp_path: Path) -> None:
    with pytest.raises(PscoverError, match="there is no folder"):
        write_mps(model(), tmp_path / "absent" / "model.mps")

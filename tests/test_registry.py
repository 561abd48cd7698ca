"""Names lead to things, and wrong names to a suggestion."""

from __future__ import annotations

import pytest

from pscover import InvalidSettings, MissingDependency, UnknownName, registry


def test_all_names() -> None:
    assert registry.names("backend") == (
        "auto", "cpsat", "cvxpy", "greedy", "highs", "lagrangian", "local-search", "lp-rounding", "pyomo", "scip", "scipy"
    )  # fmt: skip
    assert registry.names("formulation") == (
        "budgeted", "clique", "elastic", "joint", "pairwise", "robust", "scenario", "single_cover"
    )  # fmt: skip


def test_hyphens_and_underscores_are_alike() -> None:
    assert registry.lookup("backend", "lp_rounding") is registry.lookup("backend", "lp-rounding")
    assert registry.lookup("formulation", "single-cover").name == "single_cover"


def test_text_becomes_the_type_of_the_parameter() -> None:
    assert registry.make("formulation", "robust", {"gamma": "2"}).gamma == 2
    with pytest.raises(InvalidSettings, match=r"formulation 'robust': .*gamma"):
        registry.make("formulation", "robust", {"gamma": "two"})
    with pytest.raises(UnknownName, match="did you mean 'gamma'"):
        registry.make("formulation", "robust", {"gama": "2"})


def test_text_becomes_a_list() -> None:
    assert registry.make("formulation", "budgeted", {"weights": "[1, 2.5]"}).weights == (1.0, 2.5)
    for wrong in ("[1,", "1,2", '["a"]'):
        with pytest.raises(InvalidSettings, match=r"formulation 'budgeted': .*weights"):
            registry.make("formulation", "budgeted", {"weights": wrong})


def test_a_missing_package_without_an_extra_is_named_itself() -> None:
    message = str(MissingDependency.for_extra("backend 'highs'", ["highspy"], ""))
    assert message == "backend 'highs' needs the package highspy: pip install highspy"


def test_wrong_names_are_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match="unknown backend 'hihgs'; did you mean 'highs'"):
        registry.backend("hihgs")
    with pytest.raises(UnknownName, match="Known: budgeted, clique"):
        registry.formulation("zzz")

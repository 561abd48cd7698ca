"""Names lead to things, and wrong names to a suggestion."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from pscover import InvalidSettings, MissingDependency, PscoverError, UnknownName, registry


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


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            "class Cardinality: ...",
            r"own_one\.py: expected a formulation; name its class at the end of the file: formulation = ",
        ),
        (
            "import nowhere",
            r"formulation pscover\.formulations\.own_one: cannot be imported: ModuleNotFoundError: No module",
        ),
        ("def", r"formulation pscover\.formulations\.own_one: cannot be imported: SyntaxError"),
    ],
)
def test_a_file_that_holds_no_formulation(content: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_one.py").write_text(content)
    package = importlib.import_module("pscover.formulations")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    monkeypatch.delitem(sys.modules, "pscover.formulations.own_one", raising=False)
    cached = (registry._modules, registry._class)
    for function in cached:
        function.cache_clear()
    try:
        with pytest.raises(PscoverError, match=words):
            registry.lookup("formulation", "own-one")
    finally:
        for function in cached:
            function.cache_clear()
        sys.modules.pop("pscover.formulations.own_one", None)


def test_a_missing_package_without_an_extra_is_named_itself() -> None:
    message = str(MissingDependency.for_extra("backend 'highs'", ["highspy"], ""))
    assert message == "backend 'highs' needs the package highspy: pip install highspy"


def test_wrong_names_are_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match="unknown backend 'hihgs'; did you mean 'highs'"):
        registry.backend("hihgs")
    with pytest.raises(UnknownName, match="Known: budgeted, clique"):
        registry.formulation("zzz")

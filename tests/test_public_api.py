"""The public names, and that each says what it is."""

from __future__ import annotations

import inspect

import pytest

import pscover


def test_all_is_sorted_and_complete() -> None:
    public = {name for name, thing in vars(pscover).items() if not name.startswith("_") and not inspect.ismodule(thing)}
    assert pscover.__all__ == sorted(pscover.__all__)
    assert set(pscover.__all__) == public


@pytest.mark.parametrize("name", pscover.__all__)
def test_public_things_are_documented(name: str) -> None:
    assert inspect.getdoc(getattr(pscover, name))


def test_verbs_are_functions_even_though_modules_share_their_names() -> None:
    import pscover.solve
    import pscover.verify

    assert inspect.isfunction(pscover.solve)
    assert inspect.isfunction(pscover.verify)

"""The public names, and that each says what it is."""

from __future__ import annotations

import inspect
import subprocess
import sys

import pytest

import pscover


def test_all_is_sorted_and_complete() -> None:
    assert pscover.__all__ == sorted(pscover.__all__)
    assert set(pscover.__all__) == set(pscover._HOMES)
    assert set(pscover.__all__) <= set(dir(pscover))
    assert all(getattr(pscover, name) for name in pscover.__all__)


def test_unknown_names_are_missing_and_modules_are_found() -> None:
    assert not hasattr(pscover, "solv")
    assert not hasattr(pscover, "_solve")
    code = "import pscover; print(pscover.io.load_instance.__name__, pscover.Stop.__module__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "load_instance pscover.result\n"


@pytest.mark.parametrize("name", pscover.__all__)
def test_public_things_are_documented(name: str) -> None:
    assert inspect.getdoc(getattr(pscover, name))


def test_verbs_are_functions_even_though_modules_share_their_names() -> None:
    import pscover.solve
    import pscover.verify

    assert inspect.isfunction(pscover.solve)
    assert inspect.isfunction(pscover.verify)
    # In a process where the module comes first: nothing has asked for the function yet.
    code = "import pscover.testing, pscover.solve, pscover; print(pscover.solve, pscover.verify)"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.count("<function") == 2

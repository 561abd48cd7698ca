"""What the build ships, and what importing pscover costs."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import pscover
from pscover import MissingDependency, registry

ROOT = Path(__file__).parents[1]
IN_CHECKOUT = (ROOT / "pscover").is_dir()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


@pytest.mark.skipif(not IN_CHECKOUT, reason="the sources are not here")
def test_every_package_is_listed() -> None:
    found = {
        str(init.parent.relative_to(ROOT)).replace("/", ".")
        for init in (ROOT / "pscover").rglob("__init__.py")
        if "__pycache__" not in init.parts
    }
    assert sorted(found | {"pscover.formulations"}) == PROJECT["tool"]["setuptools"]["packages"]


def test_nothing_of_the_repository_leaks_to_the_top_level() -> None:
    code = "import sys, pscover.registry as r; r.names('formulation'); print([m for m in sys.modules if m[:5] == 'formu'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    assert done.stdout == "[]\n"


def test_importing_pscover_loads_no_engine_and_no_graphics() -> None:
    heavy = (
        "highspy",
        "scipy.optimize",
        "cvxpy",
        "pyomo",
        "pyscipopt",
        "ortools",
        "cv2",
        "matplotlib",
        "shapely",
        "rich",
        "torch",
    )
    code = f"import sys; from pscover import *; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_versions_agree() -> None:
    assert pscover.__version__ == PROJECT["project"]["version"] == importlib.metadata.version("pscover")


def test_every_extra_that_a_backend_names_exists() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    for name in registry.names("backend"):
        found = registry.lookup("backend", name)
        assert not found.extra or found.extra in extras, name
        assert found.extra or not registry.missing(found), name


def test_a_missing_extra_is_answered_with_the_pip_line(monkeypatch: pytest.MonkeyPatch) -> None:
    found = registry.lookup("backend", "scip")
    monkeypatch.setattr(registry, "missing", lambda backend: backend.requires)
    with pytest.raises(MissingDependency, match=r'needs the package pyscipopt: pip install "pscover\[scip\]"'):
        registry.backend(found.name)

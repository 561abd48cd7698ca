"""What `pscover doctor` says is installed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib import metadata

import pytest
from click.testing import CliRunner

from pscover import doctor
from pscover.cli.app import app
from pscover.cli.fail import Exit

LINES = [
    "numpy>=1.26",
    'cvxpy>=1.5; extra == "cvxpy"',
    'pscover[cvxpy,figures]; extra == "plan"',
    "matplotlib>=3.8; extra == 'figures'",
    'pscover[plan]; extra == "all"',
    "pscover[loop]; extra == 'loop'",
]


def pretend(monkeypatch: pytest.MonkeyPatch, versions: dict[str, str]) -> None:
    def version(name: str) -> str:
        if name not in versions:
            raise metadata.PackageNotFoundError(name)
        return versions[name]

    doctor._version.cache_clear()
    monkeypatch.setattr(metadata, "requires", lambda name: LINES)
    monkeypatch.setattr(metadata, "version", version)


@pytest.fixture(autouse=True)
def _forget() -> Iterator[None]:
    """What was pretended is not remembered by whoever asks next."""
    yield
    doctor._version.cache_clear()


def test_extras_that_include_others_list_their_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(monkeypatch, {"numpy": "2.0", "cvxpy": "1.10.0", "matplotlib": "3.7.9"})
    found = {part.extra: part for part in doctor.parts()}
    assert list(found) == ["", "cvxpy", "figures", "loop", "plan"]
    assert [package.name for package in found["plan"].packages] == ["cvxpy", "matplotlib"]
    assert found["cvxpy"].is_complete, "1.10 is newer than 1.5"
    assert not found["figures"].is_complete, "3.7.9 is older than 3.8"
    assert not found["plan"].is_complete
    assert found["loop"].packages == ()


def test_a_missing_package_is_named_with_the_line_that_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(monkeypatch, {"numpy": "2.0", "matplotlib": "3.8"})
    shown = CliRunner(env={"COLUMNS": "100"}).invoke(app, ["doctor"])
    assert shown.exit_code == Exit.VERIFIED
    assert "cvxpy missing" in shown.output
    assert 'pip install "pscover[cvxpy]"' in shown.output


def test_an_incomplete_core_is_an_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(monkeypatch, {"numpy": "1.20"})
    shown = CliRunner().invoke(app, ["doctor", "--json"])
    assert shown.exit_code == Exit.MISSING
    core = json.loads(shown.output)["parts"][0]
    assert core["packages"] == [{"name": "numpy", "needed": ">=1.26", "found": "1.20"}]

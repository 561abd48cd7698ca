"""Damaged files of every format: they are read or refused, and nothing else happens."""

from __future__ import annotations

import importlib.util
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest

from pscover import PscoverError

SCRIPT = Path(__file__).parent.parent / "bench" / "fuzz_files.py"
BATCH = 100


@pytest.fixture(scope="module")
def fuzz() -> ModuleType:
    """The script, which has the damages and runs many more of them under a memory limit."""
    if not SCRIPT.exists():
        pytest.skip("bench/fuzz_files.py is not beside the tests")
    spec = importlib.util.spec_from_file_location("fuzz_files", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["fuzz_files"] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def sound(fuzz: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> list[object]:
    seeds: list[object] = fuzz.seeds(tmp_path_factory.mktemp("sound"))
    return seeds


@pytest.mark.parametrize("begin", range(0, 700, BATCH))
def test_damaged_files_are_read_or_refused(begin: int, fuzz: ModuleType, sound: list[object], tmp_path: Path) -> None:
    counts: Counter[str] = Counter()
    for k in range(begin, begin + BATCH):
        seed, content = fuzz.mutation(sound, 1, k)
        said = fuzz.outcome(seed, content, tmp_path)
        counts[said] += 1
        assert said in ("loaded", "refused"), f"mutation {k} of {seed.name}: {said}"
    assert counts["refused"] > BATCH // 2


def test_sound_files_are_read(fuzz: ModuleType, sound: list[object], tmp_path: Path) -> None:
    assert {fuzz.outcome(seed, seed.content, tmp_path) for seed in sound} == {"loaded"}  # type: ignore[attr-defined]


def test_other_outcomes_are_noticed(fuzz: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def outcome(raised: Exception) -> str:
        def load(path: Path) -> None:
            raise raised

        monkeypatch.setattr(fuzz, "load_instance", load)
        return str(fuzz.outcome(fuzz.Seed("a.json", b"{}"), b"{}", tmp_path))

    assert outcome(KeyError("x")) == "KeyError: 'x'"
    assert outcome(PscoverError("takes more memory than there is")) == "no memory"
    assert outcome(PscoverError("wrong")) == "no file name in: wrong"
    monkeypatch.setattr(fuzz, "load_instance", lambda path: (path.parent / "left").touch())
    assert fuzz.outcome(fuzz.Seed("a.json", b"{}"), b"{}", tmp_path) == "a file was written"

"""Damaged photos, label images and annotation files: they are read or refused, and nothing else happens."""

from __future__ import annotations

import importlib.util
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

BENCH = Path(__file__).parent.parent / "bench"
BATCH = 84


def loaded(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, BENCH / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def fuzz() -> ModuleType:
    """The script, which has the damages and runs many more of them under a memory limit."""
    pytest.importorskip("cv2")
    pytest.importorskip("pycocotools")
    if not (BENCH / "fuzz_images.py").exists():
        pytest.skip("bench/fuzz_images.py is not beside the tests")
    loaded("fuzz_files")
    return loaded("fuzz_images")


@pytest.fixture(scope="module")
def sound(fuzz: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    seeds: list[Any] = fuzz.seeds(tmp_path_factory.mktemp("sound"))
    return seeds


def test_sound_files_are_read(fuzz: ModuleType, sound: list[Any], tmp_path: Path) -> None:
    assert {seed.name: fuzz.outcome(seed, seed.content, sound, tmp_path) for seed in sound} == {
        seed.name: "loaded" for seed in sound
    }


@pytest.mark.parametrize("begin", range(0, 5 * BATCH, BATCH))
def test_damaged_files_are_read_or_refused(begin: int, fuzz: ModuleType, sound: list[Any], tmp_path: Path) -> None:
    counts: Counter[str] = Counter()
    for k in range(begin, begin + BATCH):
        seed, content = fuzz.mutation(sound, 1, k)
        said = fuzz.outcome(seed, content, sound, tmp_path)
        counts[said] += 1
        assert said in ("loaded", "refused"), f"mutation {k} of {seed.name}: {said}"
    assert counts["refused"] > BATCH // 3


def test_other_outcomes_are_noticed(fuzz: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(path: Path) -> None:
        raise RuntimeError("not ours")

    monkeypatch.setattr(fuzz, "read_photo", fail)
    assert fuzz.outcome(fuzz.Seed("photo-1.jpg", b""), b"", [], tmp_path) == "RuntimeError: not ours"

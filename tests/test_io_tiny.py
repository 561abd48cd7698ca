"""Every tiny instance has the optimum that it says, by enumeration of all plans."""

from __future__ import annotations

from fractions import Fraction
from itertools import chain, combinations
from pathlib import Path

import pytest

from pscover.io import load_instance, save_instance
from pscover.io.json import encode

TINY = Path(__file__).parent.parent / "instances" / "tiny"
FILES = sorted(TINY.glob("*.json"))


def test_there_are_enough_and_each_is_explained() -> None:
    assert len(FILES) >= 8
    explained = (TINY / "README.md").read_text()
    for path in FILES:
        assert f"`{path.name}`" in explained


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_optimum_is_right(path: Path) -> None:
    instance = load_instance(path)
    p, q = instance.probability.toarray(), instance.required
    cost = [Fraction(str(c)) for c in instance.cost]
    feasible = []
    plans = chain.from_iterable(combinations(range(instance.candidates), k) for k in range(instance.candidates + 1))
    for plan in plans:
        if any(len(set(plan) & set(clique.tolist())) > 1 for clique in instance.conflicts):
            continue
        missed = [Fraction(1)] * instance.elements
        for i in plan:
            # The numbers as written, so that a requirement that is met exactly is.
            missed = [miss * (1 - Fraction(str(p[j, i]))) for j, miss in enumerate(missed)]
        if all(1 - miss >= Fraction(str(required)) for miss, required in zip(missed, q, strict=True)):
            feasible.append(sum((cost[i] for i in plan), Fraction(0)))
    optimum = instance.meta.optimum
    if optimum is None:
        assert feasible == []
        assert "no plan exists" in instance.meta.name
    else:
        assert min(feasible) == Fraction(str(optimum))
        assert instance.meta.name == path.stem
    assert instance.meta.source.startswith("by hand: ")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_files_are_written_as_pscover_writes_them(path: Path, tmp_path: Path) -> None:
    instance = load_instance(path)
    assert path.read_bytes() == encode(instance)
    save_instance(instance, tmp_path / "same.npz")
    assert load_instance(tmp_path / "same.npz").digest == instance.digest

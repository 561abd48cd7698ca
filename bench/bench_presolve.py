"""How far presolve reduces instances, and how long it takes.

pytest bench/bench_presolve.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pscover import registry
from pscover.generate.garments import garments
from pscover.generate.paper_series import series
from pscover.generate.psc import psc_on_incidence, random_psc
from pscover.grasping.candidates import candidates
from pscover.instance import Instance
from pscover.io import load_instance
from pscover.model import CoverForm, as_cover
from pscover.presolve import components, presolve

TITLE = "Presolve: rows, columns and non-zeros before and after"
PLAIN = ["scp41", "scpa1", "scpd1", "scpnre1", "scpnrg1", "rail507", "rail516", "scpclr12", "scpcyc09", "sts135"]
PROBABILISTIC = [("scp41", 0.99, 5), ("scpa1", 0.95, 10), ("scpd1", 0.95, 20), ("rail507", 0.95, 10), ("scpa1", 0.95, None)]
PILES = [(35, 0.7), (35, 0.9), (60, 0.7), (60, 0.9), (100, 0.7), (100, 0.9)]


def bench_paper_series(benchmark: Any, row: Any) -> None:
    instances = dict(series())
    for name, instance in instances.items():
        measure(row, name, instance)
    benchmark.pedantic(presolve, (form_of(instances["garments-35"]),), rounds=3)


@pytest.mark.parametrize(("count", "required"), PILES)
def bench_piles(benchmark: Any, row: Any, count: int, required: float) -> None:
    instance = candidates(garments(count, seed=0, layout="piled"), required=required)
    form = measure(row, f"{count} piled, q = {required}", instance)
    benchmark.pedantic(presolve, (form,), rounds=3)


def bench_pairwise_rows(benchmark: Any, row: Any) -> None:
    instance = candidates(garments(60, seed=0, layout="piled"))
    form = measure(row, "60 piled, pairwise", instance, "pairwise")
    benchmark.pedantic(presolve, (form,), rounds=1)


@pytest.mark.parametrize("name", PLAIN)
def bench_set_cover(benchmark: Any, row: Any, orlib: Path, name: str) -> None:
    form = measure(row, name, load_instance(orlib / f"{name}.txt"))
    benchmark.pedantic(presolve, (form,), rounds=3)


@pytest.mark.parametrize(("name", "required", "clique_size"), PROBABILISTIC)
def bench_probabilistic(benchmark: Any, row: Any, orlib: Path, name: str, required: float, clique_size: int | None) -> None:
    incidence = load_instance(orlib / f"{name}.txt")
    instance = psc_on_incidence(incidence, required=required, clique_size=clique_size)
    form = measure(row, instance.meta.name, instance)
    benchmark.pedantic(presolve, (form,), rounds=3)


@pytest.mark.parametrize("clique_size", [None, 30])
def bench_many_candidates(benchmark: Any, row: Any, clique_size: int | None) -> None:
    instance = random_psc(1000, 100_000, covers=20, clique_size=clique_size)
    form = measure(row, instance.meta.name, instance)
    benchmark.pedantic(presolve, (form,), rounds=1)


def bench_floor(benchmark: Any, row: Any) -> None:
    instance = candidates(garments(1000, seed=0, size=(2350, 2820)), required=0.6)
    form = measure(row, "1000 on a floor", instance)
    benchmark.pedantic(presolve, (form,), rounds=3)


def form_of(instance: Instance, formulation: str = "clique") -> CoverForm:
    return as_cover(registry.formulation(formulation).build(instance))


def measure(row: Any, name: str, instance: Instance, formulation: str = "clique") -> CoverForm:
    form = form_of(instance, formulation)
    reduced = presolve(form)
    blocks = components(reduced.form)
    seconds: dict[str, float] = {}
    for entry in reduced.log:
        seconds[entry.step] = seconds.get(entry.step, 0.0) + entry.seconds
    slowest = max(seconds, key=lambda step: seconds[step])
    row(
        TITLE,
        instance=name,
        rows=form.W.shape[0],
        rows_left=len(reduced.rows),
        columns=len(form.c),
        columns_left=len(reduced.columns),
        nonzeros=form.W.nnz,
        nonzeros_left=reduced.form.W.nnz,
        packing=form.P.shape[0],
        packing_left=reduced.form.P.shape[0],
        forced=len(reduced.forced),
        blocks=len(blocks),
        largest=max((len(columns) for _, columns in blocks), default=0),
        seconds=sum(seconds.values()),
        slowest=slowest,
    )
    assert reduced.status.value in ("reduced", "solved")
    return form

"""The formulation study: its clock, its statistics, its simulated worlds, and the command on something tiny."""

from __future__ import annotations

import math
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from pscover import registry
from pscover.backend import Backend
from pscover.cli.app import app
from pscover.errors import InvalidInstance, InvalidSettings, UnknownName
from pscover.evidence.study.averages import geometric_mean, penalised, shifted_mean
from pscover.evidence.study.families import FAMILIES, Problem, instance_of, problem_of
from pscover.evidence.study.metered import Metered
from pscover.evidence.study.models import ModelCase, measure_model, relaxed
from pscover.evidence.study.outcomes import (
    CommonCause,
    Entries,
    Independent,
    Overrated,
    WholeGrasps,
    World,
    simulate,
)
from pscover.evidence.study.price import PROMISES, TOGETHER, PlanCase, even_split, measure_plan
from pscover.evidence.study.profile import RESOLUTION, performance, within
from pscover.evidence.study.solves import End, SolveCase, checked_backends, exact_formulations, measure_solve, solved
from pscover.evidence.study.wilson import share_interval
from pscover.generate.psc import random_psc
from pscover.infeasibility import unreachable
from pscover.instance import Instance
from pscover.result import Settings, Status, Stop, ignore
from pscover.solve import solve

TRIALS = 40_000


def small(seed: int = 1) -> Instance:
    return random_psc(8, 24, covers=3, required=0.8, clique_size=3, seed=seed)


def hard() -> Instance:
    return random_psc(60, 240, covers=4, required=0.9, seed=0, cheapest=1, dearest=9)


# The clock


def test_metered_engine_gives_what_the_engine_gives() -> None:
    metered = Metered(engine=registry.backend("highs"), limit=20.0)
    found = solve(small(), backend=cast(Backend, metered))
    expected = solve(small(), backend="highs")
    assert (found.status, found.objective) == (Status.OPTIMAL, expected.objective)
    assert 0 < metered.spent < 20.0
    assert metered.nodes is not None


def test_metered_engine_ends_when_its_seconds_are_spent() -> None:
    metered = Metered(engine=registry.backend("scipy"), limit=0.2)
    model = registry.formulation("clique").build(hard())
    answer = metered.solve(model, Settings(), ignore)
    assert (answer.status, answer.stop) == (Status.UNKNOWN, Stop.TIME)
    assert metered.spent == pytest.approx(0.2)
    # Nothing is left: a further call must not start anything.
    assert metered.solve(model, Settings(), ignore).stop is Stop.TIME
    assert metered.spent == pytest.approx(0.2)
    assert metered.nodes is None


def test_metered_engine_keeps_what_it_was_told() -> None:
    metered = Metered(engine=registry.backend("highs"), limit=1.0)
    timing = solved(hard(), registry.formulation("clique"), metered)
    assert timing.end is End.LIMIT
    assert timing.chosen is not None
    assert timing.cost is not None
    assert timing.bound is not None
    assert timing.bound < timing.cost
    assert (hard().required - hard().coverage(timing.chosen) < 1e-9).all()


# Instances and models


@pytest.mark.parametrize("family", FAMILIES)
def test_families_are_seeded_and_within_reach(family: str) -> None:
    made = [FAMILIES[family].make(Problem(family=family, seed=seed), None) for seed in (0, 0, 1)]
    assert made[0].digest == made[1].digest != made[2].digest
    assert not unreachable(made[0])


def test_unknown_family_and_missing_file() -> None:
    with pytest.raises(UnknownName, match="'pile'"):
        problem_of("piles", 0)
    with pytest.raises(InvalidInstance, match=r"scp41\.txt"):
        instance_of(Problem(family="cover", seed=0, file="scp41"))


def test_relaxation_is_below_the_optimum_and_clique_is_never_weaker() -> None:
    instance = small()
    best = solve(instance).objective
    clique, pairwise = (relaxed(registry.formulation(name).build(instance), 20.0)[0] for name in ("clique", "pairwise"))
    assert clique is not None
    assert pairwise is not None
    assert pairwise <= clique + 1e-6
    assert clique <= best + 1e-6


def test_model_of_several_objectives_has_no_relaxation() -> None:
    done = measure_model(ModelCase(problem=Problem(family="psc", seed=0), formulation="elastic"), limit=5.0)
    assert done.row.rows
    assert done.row.relaxation is None


def test_exact_formulations_are_told_apart_by_goal() -> None:
    assert set(exact_formulations()) == set(exact_formulations(covers=True)) | set(exact_formulations(covers=False))
    assert "single_cover" not in exact_formulations()
    assert "robust" in exact_formulations(covers=False)


def test_refusals_are_rows_with_a_reason() -> None:
    pytest.importorskip("ortools")
    case = SolveCase(problem=Problem(family="psc", seed=0), formulation="elastic", backend="cpsat")
    done = measure_solve(case, limit=1.0)
    assert done.timing.end is End.REFUSED
    assert "continuous" in done.row.skipped


def test_heuristics_are_no_exact_engines() -> None:
    with pytest.raises(InvalidSettings, match="greedy"):
        checked_backends(["greedy"])


# Statistics


def test_wilson_interval_holds_the_share_as_often_as_it_says() -> None:
    random = np.random.default_rng(0)
    for share in (0.02, 0.5, 0.9):
        hits = random.binomial(60, share, size=4000)
        intervals = [share_interval(int(count), 60) for count in hits]
        assert np.mean([one.low <= share <= one.high for one in intervals]) == pytest.approx(0.95, abs=0.025)


def test_wilson_interval_of_nothing_and_all() -> None:
    assert share_interval(0, 50).low == 0.0
    assert 0 < share_interval(0, 50).high < 0.1
    assert share_interval(50, 50).high == 1.0


def test_shifted_mean_of_equal_values_is_that_value() -> None:
    found = shifted_mean([3.0, 3.0, 3.0])
    assert (found.low, found.mean, found.high) == pytest.approx((3.0, 3.0, 3.0))
    assert geometric_mean([0.5, 2.0]).mean == pytest.approx(1.0)
    assert penalised(None, solved=False, limit=4.0) == 8.0


def test_profile_counts_ties_unsolved_and_short_times() -> None:
    times = {"a": [1.0, 4.0, math.inf, 0.0001], "b": [2.0, 4.0, math.inf, 0.0002]}
    found = performance(times)
    assert [found["a"].value(1.0), found["b"].value(1.0), found["b"].value(2.0)] == [0.75, 0.5, 0.75]
    assert found["a"].value(1e9) == 0.75
    assert within(times)["b"].at == (RESOLUTION, 2.0, 4.0)


# Worlds


def pair() -> Instance:
    return Instance.of([[0.6, 0.5, 0.0], [0.7, 0.0, 0.4]], required=[0.7, 0.8])


@pytest.mark.parametrize("world", [Independent(), WholeGrasps(), CommonCause(0.5), CommonCause(1.0)])
def test_worlds_keep_every_single_probability(world: World) -> None:
    entries = Entries.of(pair(), (0, 1, 2))
    drawn = world.draw(entries, TRIALS, np.random.default_rng(1))
    assert drawn.mean(axis=0) == pytest.approx(entries.probability, abs=0.012)


def test_worlds_differ_in_what_happens_together() -> None:
    instance, chosen = pair(), (0, 1, 2)
    independent = simulate(instance, chosen, Independent(), TRIALS, seed=2)
    coverage = instance.coverage(chosen)
    assert independent.together / TRIALS == pytest.approx(coverage.prod(), abs=0.012)
    assert independent.covered == pytest.approx(coverage.mean(), abs=0.01)
    # An element fails with the best of its grasps when one cause decides, and a pair of elements together.
    common = simulate(instance, chosen, CommonCause(1.0), TRIALS, seed=2)
    assert common.covered == pytest.approx(np.mean([0.6, 0.7]), abs=0.01)
    assert common.together / TRIALS == pytest.approx(0.6, abs=0.012)
    assert common.broken == 1.0
    # One draw a grasp leaves each element as it was, and brings misses together.
    whole = simulate(instance, chosen, WholeGrasps(), TRIALS, seed=2)
    assert whole.covered == pytest.approx(independent.covered, abs=0.01)
    assert whole.together > independent.together


def test_the_worst_grasp_of_each_element_is_overrated() -> None:
    instance = pair()
    drawn = Overrated(0.1).draw(Entries.of(instance, (0, 1, 2)), TRIALS, np.random.default_rng(3))
    # By candidate, then by element: (0.4 + 0.1) / 0.4 > (0.5 + 0.1) / 0.5, and the same for the other element.
    assert drawn.mean(axis=0) == pytest.approx([0.5, 0.6, 0.5, 0.4], abs=0.012)


def test_elements_without_grasps_are_missed_and_those_without_requirement_do_not_count() -> None:
    instance = Instance.of([[0.9], [0.0], [0.0]], required=[0.5, 0.5, 0.0])
    found = simulate(instance, (0,), Independent(), 1000, seed=0)
    assert found.together == 0
    assert found.broken == 0.5
    assert found.worst == 0.5
    assert simulate(instance, (), Independent(), 10, seed=0).covered == 0.0


def test_plans_of_an_even_split_cover_all_at_once() -> None:
    instance = random_psc(5, 40, covers=2, required=0.7, seed=3)
    plan = solve(even_split(instance)).chosen
    assert plan is not None
    assert not (even_split(instance).required < instance.required).any()
    found = simulate(instance, tuple(plan.tolist()), Independent(), TRIALS, seed=4)
    assert share_interval(found.together, TRIALS, 0.999).high >= TOGETHER


def test_stronger_promises_cost_no_less_and_hold() -> None:
    problem = Problem(family="psc", seed=0)
    found = {
        promise: measure_plan(PlanCase(problem=problem, promise=promise), 20.0, 4000, "highs").timing
        for promise in ("clique", "single_cover", "robust")
    }
    assert set(found) < set(PROMISES)
    costs = {promise: timing.solve.cost for promise, timing in found.items()}
    base = costs.pop("clique")
    assert base is not None
    # One grasp alone may not do for some element: then that promise is impossible.
    assert all(cost >= base - 1e-6 for cost in costs.values() if cost is not None)
    assert found["single_cover"].solve.end in (End.SOLVED, End.INFEASIBLE)
    assert costs["robust"] is not None
    by_world = {outcome.world: outcome for outcome in found["robust"].outcomes}
    assert by_world["one overrated by 0.1"].broken == 0.0


# The command


def test_command_writes_tables_and_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    arguments = ["bench", "study", "--families", "apart", "--seeds", "1", "--backends", "highs", "--limit", "0.2"]
    lines = []
    for _ in range(2):
        with pytest.raises(SystemExit) as ended:
            app.main([*arguments, "--trials", "50", "-o", str(tmp_path / "study")])
        assert ended.value.code == 0, capsys.readouterr().err
        lines.append((tmp_path / "study" / "solves" / "timings.jsonl").read_bytes())
    # What was measured is not measured again.
    assert lines[0] == lines[1]
    page = (tmp_path / "study" / "study.md").read_text()
    for title in ("Size of the models", "The problem itself", "What a promise costs", "Whether promises are kept"):
        assert title in page
    assert (tmp_path / "study" / "study-clique-pairwise.csv").exists()
    assert (tmp_path / "study" / "profile.svg").read_bytes().startswith(b"<?xml")


# The page


def test_tables_of_the_page_are_those_that_were_measured() -> None:
    root = Path(__file__).parents[1]
    page, measured = root / "docs" / "study.md", root / "bench" / "results" / "study" / "study.md"
    if not page.exists():
        pytest.skip("docs/ is not in an installed package")
    lines = [line for line in page.read_text().splitlines() if line.startswith("|")]
    assert len(lines) > 20
    known = set(measured.read_text().splitlines())
    assert [line for line in lines if line not in known] == []

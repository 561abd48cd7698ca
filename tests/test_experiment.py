"""Experiments count what is true, go on after a kill, and end with the same bytes."""

from __future__ import annotations

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from pscover import EngineFailed, InvalidResult, InvalidSettings
from pscover.cli.app import app
from pscover.evidence.executors import ATTEMPTS, cluster, processes
from pscover.execution.sight import Sight
from pscover.experiment.batch import run_all, trials
from pscover.experiment.published import TABLE_1
from pscover.experiment.statistics import bootstrap, ratio, rows
from pscover.experiment.store import Store
from pscover.experiment.tables import NARROW, cells, markdown, write_results
from pscover.experiment.trial import Outcome, Timing, Trial, policy_of, run
from pscover.experiment.worlds import opened
from pscover.policies.height import Height
from pscover.policy import Decision

sys.path.insert(0, str(Path(__file__).parent))
from dask_workers import two_workers

BASE = Trial(policy="random", world="tabletop")
RESULTS = ("episodes.csv", "summary.csv", "summary.md", "policies.png", "experiment.json")


class Inline(Executor):
    """Runs what is submitted at once, in this process."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as problem:
            future.set_exception(problem)
        return future


@contextmanager
def inline() -> Iterator[Executor]:
    yield Inline()


def outcome(policy: str = "random", seed: int = 0, carried: tuple[int, ...] = (1, 2, 0), **changed: Any) -> Outcome:
    plain: dict[str, Any] = {"garments": 3, "picks": 3, "places": 0, "failures": 0, "stand_ins": 0, "fallen": 0, "left": 0}
    plain |= {"seconds": 60.0, "reason": "clear", **changed}
    return Outcome(policy=policy, seed=seed, carried=carried, **plain)


def test_worlds_of_equal_seeds_are_equal_and_others_are_not() -> None:
    one, same, other = (opened("tabletop", seed).camera.capture() for seed in (3, 3, 4))
    assert (one.rgb == same.rgb).all()
    assert (one.rgb != other.rgb).any()


def test_an_episode_counts_garments_trips_and_places() -> None:
    found, timing = run(replace(BASE, policy="consolidation", options=(("backend", "greedy"),)))
    assert found.garments == found.removed == 10
    assert found.left == found.fallen == 0
    assert found.trips == len(found.carried) == found.picks - found.places
    assert found.places > 0
    assert found.seconds == 10 * found.picks + 6 * found.places + 8 * found.trips
    assert 0 < timing.deciding <= timing.total


def test_runs_of_equal_trials_are_equal() -> None:
    assert run(BASE)[0] == run(BASE)[0]
    assert run(BASE)[0] != run(replace(BASE, seed=1))[0]


def test_empty_trips_count_in_one_measure_only() -> None:
    found = outcome(carried=(2, 0, 1, 0))
    assert (found.opt, found.opt_without_empty) == (0.75, 1.5)
    assert (found.trips, found.empty) == (4, 2)
    nothing = outcome(carried=())
    assert math.isnan(nothing.opt)
    assert math.isnan(nothing.opt_without_empty)


def test_a_limit_of_trips_ends_an_episode() -> None:
    found, _ = run(replace(BASE, patience=replace(BASE.patience, most_transports=2)))
    assert found.reason == "most transports reached"
    assert found.trips == 2
    assert found.left == 10 - found.removed


def test_intervals_are_those_of_resampled_scenes() -> None:
    values = np.random.default_rng(0).normal(5, 1, 400).tolist()
    interval = bootstrap(values)
    half = 1.96 / math.sqrt(400)
    assert interval.mean == pytest.approx(np.mean(values))
    assert interval.high - interval.mean == pytest.approx(half, rel=0.15)
    assert interval.mean - interval.low == pytest.approx(half, rel=0.15)
    assert bootstrap([2.0, math.nan]).high == 2.0
    assert math.isnan(bootstrap([]).mean)


def test_paired_ratios_forget_what_scenes_have_in_common() -> None:
    hard = np.random.default_rng(0).uniform(0.5, 3, 60)
    paired = ratio((1.5 * hard).tolist(), hard.tolist())
    assert paired.low == pytest.approx(1.5)
    assert paired.high == pytest.approx(1.5)
    assert math.isnan(ratio([1.0], [0.0]).mean)


def test_rows_compare_over_shared_scenes_only() -> None:
    found = rows([outcome(seed=0), outcome(seed=1), outcome("segment", 1, (3,)), outcome("segment", 7, (3,), reason="x")])
    assert [row.policy for row in found] == ["random", "segment"]
    assert found[1].episodes == 2
    assert found[1].cleared == 1
    assert found[1].gain.mean == pytest.approx(3.0)
    assert found[0].empty == 1.0


def test_the_papers_row_stands_beside_ours() -> None:
    row = rows([outcome("segment", 0, (2, 1))])[0]
    assert cells(row)["paper"] == "1.55±0.11"
    assert "174" in markdown([row])
    assert set(NARROW) <= set(cells(row))
    assert set(TABLE_1) >= {"random", "height", "volume", "segment", "hybrid-height", "hybrid-volume", "consolidation"}


def test_a_second_run_runs_only_what_is_missing(tmp_path: Path) -> None:
    store = Store.of(tmp_path, BASE)
    seen: list[tuple[str, int]] = []
    listed = trials(BASE, ["random", "height"], range(2))
    run_all(listed[:3], store, inline, lambda found: seen.append((found.policy, found.seed)))
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.json")}
    run_all(listed, store, inline, lambda found: seen.append((found.policy, found.seed)))
    after = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.json")}
    assert len(seen) == 3 + 4
    assert all(after[path] == stamp for path, stamp in before.items())
    assert store.timing("height", 1) is not None


def test_a_trial_that_raises_costs_no_other(tmp_path: Path) -> None:
    store = Store.of(tmp_path, BASE)
    bad = replace(BASE, policy="nobody")
    done: list[str] = []
    with pytest.raises(LookupError, match="nobody"):
        run_all([bad, BASE], store, inline, lambda found: done.append(found.policy))
    assert done == ["random"]
    assert store.outcome("random", 0) is not None


def test_workers_that_die_are_replaced_up_to_a_limit(tmp_path: Path) -> None:
    deaths = 0

    class Dying(Inline):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            nonlocal deaths
            if deaths < limit:
                deaths += 1
                future: Future[Any] = Future()
                future.set_exception(BrokenProcessPool("killed"))
                return future
            return super().submit(fn, *args, **kwargs)

    @contextmanager
    def dying() -> Iterator[Executor]:
        yield Dying()

    limit = 1
    done: list[int] = []
    run_all([BASE], Store.of(tmp_path / "a", BASE), dying, lambda found: done.append(found.seed))
    assert done == [0]
    deaths, limit = 0, 10**6
    with pytest.raises(EngineFailed, match=f"died {ATTEMPTS} times over 1 cases \\(random on scene 0"):
        run_all([BASE], Store.of(tmp_path / "b", BASE), dying, lambda found: None)


def test_processes_run_trials(tmp_path: Path) -> None:
    store = Store.of(tmp_path, BASE)
    run_all([BASE], store, lambda: processes(1), lambda found: None)
    assert store.outcome("random", 0) == run(BASE)[0]
    with pytest.raises(InvalidSettings, match="jobs"), processes(0):
        pass


def test_other_settings_need_another_folder(tmp_path: Path) -> None:
    Store.of(tmp_path, BASE)
    Store.of(tmp_path, replace(BASE, policy="height", seed=5, cache="elsewhere"))
    with pytest.raises(InvalidSettings, match="another folder"):
        Store.of(tmp_path, replace(BASE, options=(("points", "3"),)))


def test_the_engine_of_plans_is_one_that_finds_the_same_again_and_is_named(tmp_path: Path) -> None:
    for trial, engine in ((BASE, "highs"), (replace(BASE, options=(("backend", "greedy"),)), "greedy")):
        Store.of(tmp_path / engine, trial)
        settings = json.loads((tmp_path / engine / "experiment.json").read_text())
        assert settings["options"]["backend"] == engine
        for policy in ("segment", "segment-all", "segment-replan", "hybrid-volume", "hybrid-height", "consolidation"):
            assert policy_of(replace(trial, policy=policy)).cycle.backend == engine  # type: ignore[attr-defined]


def test_a_folder_with_anything_else_in_it_is_refused_and_left_alone(tmp_path: Path) -> None:
    mine = tmp_path / "thesis.txt"
    mine.write_text("mine")
    with pytest.raises(InvalidSettings, match=r"thesis\.txt.*another folder"):
        Store.of(tmp_path, BASE)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]
    done = simulate(tmp_path, "--policy", "random", "--episodes", "1")
    assert done.exit_code == 2
    assert "thesis.txt" in done.stderr
    assert mine.read_text() == "mine"


def test_a_new_record_replaces_an_old_one_and_nothing_else(tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    trial = replace(BASE, record=str(tmp_path))
    folder = tmp_path / "random" / "0000"
    run(trial)
    first = sorted(path.name for path in folder.iterdir())
    (folder / "notes.txt").write_text("mine")
    (folder / "999999.png").write_text("of a longer run that was cut off")
    run(trial)
    assert sorted(path.name for path in folder.iterdir()) == [*first, "notes.txt"]
    (folder / "episode.jsonl").unlink()
    with pytest.raises(InvalidResult, match=r"expected a record"):
        run(trial)
    assert (folder / first[0]).exists()
    (folder / "episode.jsonl").write_text('{"schema": "another program"}\n')
    with pytest.raises(InvalidResult, match=r"expected a record of schema"):
        run(trial)
    assert (folder / first[0]).exists()


class Flagging:
    """The policy `height`, which fails at every second trip."""

    name = "height"
    needs_depth = True

    def __init__(self) -> None:
        self.calls = 0

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        self.calls += 1
        if self.calls % 2 == 0:
            raise EngineFailed("no idea")
        return Height().next(sight, state, random)


def test_trips_that_a_random_grasp_stands_in_for_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    policy = Flagging()
    monkeypatch.setattr("pscover.experiment.trial.policy_of", lambda trial: policy)
    found, _ = run(replace(BASE, policy="height"))
    assert found.trips > 2
    assert found.stand_ins == found.trips // 2 == policy.calls // 2
    row = rows([found, outcome("height", 1, stand_ins=0)])[0]
    assert row.stand_ins == found.stand_ins / 2
    assert cells(row)["stood in"] == f"{row.stand_ins:.1f}"


def test_cloth_without_numba_is_answered_with_the_pip_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name, package=None: None)
    done = CliRunner().invoke(app, ["simulate", "--episodes", "1", "-o", str(tmp_path)])
    assert done.exit_code == 3
    assert 'pip install "pscover[sim]"' in done.stderr


def test_damaged_episodes_are_named(tmp_path: Path) -> None:
    store = Store.of(tmp_path, BASE)
    store.save(outcome(), Timing(deciding=1.0, total=2.0))
    path = tmp_path / "episodes" / "random" / "0000.json"
    path.write_bytes(path.read_bytes()[:20])
    with pytest.raises(InvalidResult, match=r"0000\.json: .*delete it"):
        store.outcome("random", 0)


def test_tables_hold_the_same_numbers(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow.parquet")
    store = Store.of(tmp_path, BASE)
    found = [outcome(seed=seed) for seed in range(3)]
    write_results(store, found, rows(found))
    with (tmp_path / "episodes.csv").open() as file:
        read = list(csv.DictReader(file))
    table = pyarrow.read_table(tmp_path / "episodes.parquet").to_pylist()
    assert [int(record["trips"]) for record in read] == [record["trips"] for record in table] == [3, 3, 3]


def simulate(folder: Path, *arguments: str) -> Any:
    line = ["simulate", "--world", "tabletop", "-o", str(folder), *arguments]
    return CliRunner().invoke(app, line)


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pscover.evidence.executors.processes", lambda jobs: inline())


@pytest.mark.usefixtures("in_this_process")
def test_the_command_compares_policies_and_writes_everything(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("cv2")
    folder = tmp_path / "out"
    done = simulate(folder, "--policy", "random,segment", "--episodes", "2", "--set-policy", "backend=greedy", "--record")
    assert done.exit_code == 0, done.output
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "1.07±0.07" in done.stdout
    for name in (*RESULTS, "timing.csv"):
        assert (folder / name).stat().st_size > 50
    assert (folder / "records" / "segment" / "0001" / "episode.jsonl").is_file()
    with (folder / "episodes.csv").open() as file:
        records = list(csv.DictReader(file))
    assert [(record["policy"], record["seed"]) for record in records] == [
        ("random", "0"), ("random", "1"), ("segment", "0"), ("segment", "1")
    ]  # fmt: skip
    assert not any("wall" in name or "deciding" in name for name in records[0])


@pytest.mark.usefixtures("in_this_process")
def test_the_command_sorts_and_prints_json(tmp_path: Path) -> None:
    done = simulate(tmp_path, "--policy", "segment", "--episodes", "1", "--baskets", "white,dark", "--json", "-q")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["policies"][0]["cleared"] == 1
    done = simulate(tmp_path / "json", "--policy", "random", "--episodes", "1", "--json", "-q")
    assert json.loads(done.stdout)["policies"][0]["policy"] == "random"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--policy", "segmnet"), "did you mean 'segment'"),
        (("--policy", "segment", "--set-policy", "pionts=3"), "did you mean 'points'"),
        (("--policy", "segment", "--set-policy", "points=0"), "points"),
        (("--policy", "segment", "--set-policy", "backend=higs"), "did you mean 'highs'"),
        (("--policy", "segment", "--baskets", "white,red"), "unknown class of laundry 'red'"),
        (("--segmenter", "sma"), "did you mean 'sam'"),
        (("--predictor", "/nowhere.json"), "no such file"),
        (("--empty-below", "-1"), "empty_kilograms"),
        (("--scheduler", "tcp://127.0.0.1:1"), "scheduler"),
    ],
)
@pytest.mark.usefixtures("in_this_process")
def test_mistakes_are_one_line(
    tmp_path: Path, arguments: tuple[str, ...], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pscover.evidence.executors.ANSWER", 0.5)
    if "--scheduler" in arguments:
        pytest.importorskip("distributed")
    done = simulate(tmp_path, "--episodes", "1", *arguments)
    assert done.exit_code == 2
    assert message in done.stderr
    assert len([line for line in done.stderr.splitlines() if line.startswith("pscover: error")]) == 1
    assert "Traceback" not in done.stderr


def test_killed_and_resumed_gives_the_same_bytes(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    arguments = ("--policy", "random,height", "--episodes", "2", "-q")
    command = [sys.executable, "-m", "pscover", "simulate", "--world", "tabletop", *arguments, "-o"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pscover.evidence.executors.processes", lambda jobs: inline())
        assert simulate(tmp_path / "whole", *arguments).exit_code == 0
    cut = tmp_path / "cut"
    process = subprocess.Popen(
        [*command, str(cut)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    while len(list(cut.glob("episodes/*/*.json"))) < 2 and process.poll() is None:
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    kept = len(list(cut.glob("episodes/*/*.json")))
    assert 2 <= kept <= 4
    (cut / "episodes" / "random" / "0001.json").unlink(missing_ok=True)
    subprocess.run([*command, str(cut)], check=True, capture_output=True)
    for name in RESULTS:
        assert (cut / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    for path in (tmp_path / "whole").glob("episodes/*/*.json"):
        assert (cut / path.relative_to(tmp_path / "whole")).read_bytes() == path.read_bytes()


def test_a_cluster_loses_nothing_when_a_worker_is_killed(tmp_path: Path) -> None:
    store, listed = Store.of(tmp_path, BASE), trials(BASE, ["random", "height"], range(4))
    done: list[tuple[str, int]] = []
    with two_workers() as workers:

        def everything(alive: Callable[[], None]) -> None:
            def count(found: Outcome) -> None:
                done.append((found.policy, found.seed))
                workers.kill_one()
                alive()

            run_all(listed, store, lambda: cluster(workers.address), count)

        workers.finish(everything)
    assert sorted(done) == sorted((trial.policy, trial.seed) for trial in listed)
    for trial in listed[:2]:
        assert store.outcome(trial.policy, trial.seed) == run(trial)[0]

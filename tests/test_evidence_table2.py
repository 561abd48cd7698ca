"""Table 2 and the third experiment: what is counted, what is fitted, and what an engine's limit does."""

from __future__ import annotations

import csv
import math
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from pscover import InvalidSettings, Scene
from pscover.cli.app import app
from pscover.evidence.growth import ENGINES, Case, Growth, Seen, Took, climb, groups_of, scene, sweep
from pscover.evidence.machine import this_machine
from pscover.evidence.sweep import Done, Store
from pscover.evidence.table2 import PAPER, Line, exponent, group_table, growth_table, lines, size_table, trend
from pscover.evidence.timed import Engine, Run
from pscover.generate.garments import garments
from pscover.generate.paint import paint

LIMIT = 20.0


def inline() -> AbstractContextManager[Executor]:
    return ThreadPoolExecutor(1)


def run(engine: str, seconds: float) -> Run:
    is_cut_off = seconds >= LIMIT
    status = "unknown" if is_cut_off else "optimal"
    return Run(engine=engine, seconds=seconds, is_cut_off=is_cut_off, status=status, objective=None, bound=None)


def invented(case: Case) -> Done[Seen, Took]:
    """SciPy's time grows with the square, HiGHS' with the number, both a little with the seed; auto's not at all."""
    size, more = case.garments, 1 + 0.1 * case.seed
    seconds = {"scipy/pairwise": 0.01 * more * size**2, "highs/clique": 0.01 * more * size, "auto/clique": 0.05}
    took = Took(
        segmentation=0.3 * more, candidates=0.01, runs=tuple(run(engine, seconds[engine]) for engine in case.engines)
    )
    row = Seen(segments=size, out_of_reach=0, candidates=30 * size, entries=30 * size, cliques=size, digest="")
    return Done(row=row, timing=took)


def store(folder: Path) -> Store[Case, Seen, Took]:
    return Store(folder, sweep("table2", LIMIT))


def kept(folder: Path, cases: list[Case]) -> list[Line]:
    made = store(folder)
    for case in cases:
        made.save(case, invented(case), this_machine())
    return lines(made)


def climbed(folder: Path, sizes: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> list[Line]:
    monkeypatch.setattr(Growth, "__call__", lambda self, case: invented(case))
    made = store(folder)
    climb(made, sizes, range(3), ENGINES, inline, lambda case, row: None)
    return lines(made)


def test_an_engine_that_was_cut_off_is_left_out_of_larger_sizes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = climbed(tmp_path, (5, 40, 44, 50, 10), monkeypatch)
    assert [line.garments for line in found] == [5, 10, 40, 44, 50]
    assert ["scipy/pairwise" in line.stages for line in found] == [True, True, True, True, False]
    column = found[3].stages["scipy/pairwise"]
    assert (column.cut_off, len(column.seconds)) == (2, 1)
    assert str(column) == "> 23.2 (2 of 3 cut off)"
    table = size_table(found, LIMIT)
    assert table.rows[-1][table.columns.index("scipy pairwise s")] == "left out"
    assert any("left out" in note for note in table.notes)
    again = climbed(tmp_path, (5, 10, 40, 44, 50), monkeypatch)
    assert again == found


def test_exponents_are_those_of_the_law(tmp_path: Path) -> None:
    found = kept(tmp_path, [Case(garments=size, seed=seed) for size in (5, 10, 20, 35, 44) for seed in range(3)])
    for stage, power in (("scipy/pairwise", 2.0), ("highs/clique", 1.0), ("auto/clique", 0.0), ("segmentation", 0.0)):
        fitted = exponent(found, stage)
        assert (fitted.mean, fitted.low, fitted.high) == pytest.approx((power, power, power), abs=1e-9)
    assert math.isnan(exponent(found[:2], "highs/clique").mean)
    assert growth_table(found).rows[-1][:2] == ("MILP of the paper", "1.39")


def test_the_papers_numbers_stand_beside_ours(tmp_path: Path) -> None:
    found = kept(tmp_path, [Case(garments=size, seed=0) for size in (*PAPER, 50)])
    table = size_table(found, LIMIT, {"mobile-sam": found[:1]})
    assert table.rows[6][-3:] == ("35", "18.7", "22.3")
    assert table.rows[7][-3:] == ("–",) * 3
    beside = table.columns.index("mobile-sam: segments")
    assert [row[beside] for row in table.rows[:2]] == ["5", "–"]


def test_trends_are_relative_to_the_mean(tmp_path: Path) -> None:
    found = kept(tmp_path, [Case(garments=35, groups=k, seed=0) for k in (1, 2, 4)])
    assert trend(found, "highs/clique").mean == pytest.approx(0.0, abs=1e-9)
    assert [row[0] for row in group_table(found, LIMIT).rows] == ["1", "2", "4"]


def test_pictures_are_drawn_of_both(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from pscover.figures.growth import growth_figure, save_growth_figure

    by_size = kept(tmp_path / "a", [Case(garments=size, seed=seed) for size in (5, 20, 50) for seed in range(2)])
    figure = growth_figure(by_size, {"mobile-sam": by_size[:2]}, LIMIT)
    left, right = figure.axes
    assert left.get_xscale() == right.get_yscale() == "log"
    legends = [legend for axes in figure.axes if (legend := axes.get_legend()) is not None]
    shown = [text.get_text() for legend in legends for text in legend.get_texts()]
    assert {"segmentation, classical", "segmentation, mobile-sam", "MILP, paper", "scipy, pairwise"} <= set(shown)
    by_groups = kept(tmp_path / "b", [Case(garments=35, groups=k, seed=0) for k in (1, 2, 4)])
    figure = growth_figure(by_groups, {}, LIMIT)
    assert figure.axes[0].get_xscale() == "linear"
    save_growth_figure(by_groups, {}, LIMIT, tmp_path / "groups.svg")
    assert (tmp_path / "groups.svg").read_bytes().startswith(b"<?xml")


def test_garments_are_painted_pixel_by_pixel_as_before() -> None:
    labels = np.zeros((40, 50), dtype=int)
    labels[0:12, 0:20], labels[20:40, 30:50], labels[30:33, 5:9] = 1, 2, 3
    from scipy.ndimage import distance_transform_edt

    from pscover.generate.paint import _inside

    made = Scene.of(labels)
    whole = sum(distance_transform_edt(made.segments == j) for j in range(3))
    assert (_inside(made) == whole).all()
    assert paint(garments(2, seed=0)).shape == (282, 470, 3)


def test_a_case_is_measured_for_real() -> None:
    pytest.importorskip("cv2")
    pytest.importorskip("skimage")
    case = Case(garments=4, groups=1, seed=0, engines=("scipy/pairwise", "highs/clique"))
    done = Growth(limit=LIMIT)(case)
    assert done.row.segments == 4
    assert done.row.candidates > 100
    assert done.row == Growth(limit=LIMIT)(Case(garments=4, groups=1, seed=0, engines=())).row
    assert [run.engine for run in done.timing.runs] == ["scipy/pairwise", "highs/clique"]
    assert all(run.status == "optimal" and 0 < run.seconds < LIMIT for run in done.timing.runs)
    assert done.timing.runs[0].objective == done.timing.runs[1].objective


def test_larger_tables_have_the_paper_s_density() -> None:
    assert scene(Case(garments=5, seed=0)).shape == (282, 470)
    assert scene(Case(garments=60, seed=0)).shape == (396, 660)
    assert groups_of(35, 12) == (3,) * 11 + (2,)
    with pytest.raises(InvalidSettings, match="BACKEND/FORMULATION"):
        Engine.parse("highs")


def bench(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["bench", *arguments])


def test_the_commands_write_tables_pictures_and_raw_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(Growth, "__call__", lambda self, case: invented(case))
    monkeypatch.setattr("pscover.evidence.executors.processes", lambda jobs: inline())
    done = bench("table2", "--garments", "5,10,50", "--seeds", "2", "--segmenters", "mobile-sam", "-o", str(tmp_path / "a"))
    assert done.exit_code == 0, done.output
    names = {"growth.csv", "results.jsonl", "sweep.json", "table2.csv", "table2.md", "table2.svg", "timings.jsonl"}
    assert names | {"machines.jsonl"} == {path.name for path in (tmp_path / "a").iterdir()}
    with (tmp_path / "a" / "table2.csv").open() as file:
        assert [row["garments"] for row in csv.DictReader(file)] == ["5", "10", "50"]
    done = bench("groups", "--groups", "1,3,5", "--seeds", "2", "-o", str(tmp_path / "b"), "--json")
    assert done.exit_code == 0, done.output
    assert '"groups": "5"' in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("table2", "--garments", "0,5"), "--garments: expected whole numbers from 1"),
        (("table2", "--engines", "higs/clique"), "did you mean 'highs'"),
        (("table2", "--engines", "highs"), "BACKEND/FORMULATION"),
        (("table2", "--segmenters", "clasical"), "did you mean 'classical'"),
        (("table2", "--limit", "0"), "--limit: expected a positive number"),
        (("groups", "--groups", "13"), "--groups: expected whole numbers from 0 to 12"),
        (("tabel2",), "did you mean 'table2'"),
    ],
)
def test_mistakes_are_one_line(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    done = bench(*arguments, "-o", str(tmp_path / "x"))
    assert done.exit_code == 2
    assert message in done.stderr
    assert len([line for line in done.stderr.splitlines() if line.startswith("pscover: error")]) == 1
    assert not (tmp_path / "x").exists()

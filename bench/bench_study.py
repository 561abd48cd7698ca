"""The formulation study: every exact formulation on every exact engine, and what stronger promises cost and keep.

    pytest bench/bench_study.py

takes up the study in `bench/results/study` where it stopped, and writes its tables; `pscover bench study` does the same
anywhere. A smoke run takes one family, one seed and a fraction of a second for each solve.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from pscover.evidence.executors import processes
from pscover.evidence.study.price import plan_cases
from pscover.evidence.study.promises import Plans
from pscover.evidence.study.report import Study, tables, write_study
from pscover.evidence.study.solves import BACKENDS, exact_formulations, solve_cases
from pscover.evidence.study.speed import Speed
from pscover.evidence.study.sweeps import MODELS, PLANS, SOLVES, model_cases, models, plans, problems, solves
from pscover.evidence.sweep import Store, run_sweep

RESULTS = Path(__file__).parent / "results" / "study"
LIMIT, SEEDS, TRIALS = 5.0, 3, 20_000
JOBS = 3
"""Processes: the clock is CPU seconds, so that they disturb each other little."""


def bench_study(benchmark: Any, row: Any, tmp_path: Path, request: Any) -> None:
    real = benchmark.enabled
    folder = RESULTS if real else tmp_path
    limit, trials = (LIMIT, TRIALS) if real else (0.2, 100)
    files = request.getfixturevalue("orlib") if real else None
    listed = problems(seeds=SEEDS, folder=files) if real else problems(("apart",), seeds=1)
    plain, other = exact_formulations(covers=True), exact_formulations(covers=False)
    engines = BACKENDS if real else ("highs",)
    sized = Store(folder / MODELS, models(limit, files))
    solved = Store(folder / SOLVES, solves(limit, files))
    planned = Store(folder / PLANS, plans(limit, trials, engines[0], files))

    def everything() -> None:
        places = partial(processes, JOBS if real else 1)
        run_sweep(sized, model_cases(listed, (*plain, *other, "single_cover", "joint")), places)
        run_sweep(solved, solve_cases(listed, plain, engines) + solve_cases(listed, other, engines), places)
        run_sweep(planned, plan_cases(listed), places)

    benchmark.pedantic(everything, rounds=1)
    study = Study(Speed(sized, solved, limit), Plans(planned))
    made = tables(study)
    write_study(study, folder, made)
    for table in made:
        for line in table.rows:
            row(table.title, **dict(zip(table.columns, line, strict=True)))

"""`pscover bench study`: formulations compared, in time and in what they promise."""

from __future__ import annotations

from pathlib import Path

import click

from pscover.cli.fail import Exit
from pscover.cli.options import FILE, json_option, names, quiet_option
from pscover.cli.output import wrote_into
from pscover.cli.sweeping import checked_limit, output_option, pictured, print_tables, swept
from pscover.cli.workers import worker_options, workers


@click.command("study", short_help="Formulations on engines, and what stronger promises cost.")
@output_option
@click.option("--families", type=names, metavar="A,B,...", help="With commas between them; all by default.")
@click.option("--seeds", type=click.IntRange(1, 1000), default=3, show_default=True, help="Instances of each family.")
@click.option(
    "--backends", "-b", type=names, metavar="A,B,...", help="Exact engines; the first finds the plans of promises."
)
@click.option("--limit", type=float, default=10.0, show_default=True, metavar="SECONDS", help="Of CPU, for each solve.")
@click.option("--trials", type=click.IntRange(1, 10_000_000), default=20_000, show_default=True, help="Of each plan.")
@click.option("--orlib", type=FILE, metavar="DIR", help="Folder of OR-Library files; otherwise stand-ins are generated.")
@worker_options
@json_option
@quiet_option
def command(
    output: Path,
    families: tuple[str, ...] | None,
    seeds: int,
    backends: tuple[str, ...] | None,
    limit: float,
    trials: int,
    orlib: Path | None,
    jobs: int,
    scheduler: str | None,
    as_json: bool,
    quiet: bool,
) -> Exit:
    """Compare formulations: size, relaxation and time on every exact engine, and the price of stronger promises.

    Every exact formulation is solved by every engine on seeded families of instances, under a limit of CPU seconds. Then
    plans of several formulations are tried in simulated worlds, in some of which grasps fail together. DIR gets a line a
    case, so that an interrupted run goes on; its tables and its picture are made of these lines.

    \b
    Examples:
      pscover bench study -o study/
      pscover bench study --families apart,pile --seeds 5 --limit 5 --jobs 2 -o study/
    """
    from pscover.evidence.study.families import FAMILIES
    from pscover.evidence.study.price import plan_cases
    from pscover.evidence.study.promises import Plans
    from pscover.evidence.study.report import Study, draw, tables, write_study
    from pscover.evidence.study.solves import BACKENDS, checked_backends, exact_formulations, solve_cases
    from pscover.evidence.study.speed import Speed
    from pscover.evidence.study.sweeps import MODELS, PLANS, SOLVES, model_cases, models, plans, problems, solves
    from pscover.evidence.sweep import Store, run_sweep

    limit, places = checked_limit(limit), workers(jobs, scheduler)
    listed = problems(families or tuple(FAMILIES), seeds, orlib)
    plain, other = exact_formulations(covers=True), exact_formulations(covers=False)
    engines = checked_backends(backends or BACKENDS)
    output.mkdir(parents=True, exist_ok=True)
    sized = Store(output / MODELS, models(limit, orlib))
    solved = Store(output / SOLVES, solves(limit, orlib))
    planned = Store(output / PLANS, plans(limit, trials, engines[0], orlib))
    sizes = model_cases(listed, (*plain, *other, "single_cover", "joint"))
    # The problem itself first: a run that is cut off has compared its formulations on all instances.
    runs = solve_cases(listed, plain, engines) + solve_cases(listed, other, engines)
    promises = plan_cases(listed)
    for run, total in (
        (lambda done: run_sweep(sized, sizes, places, done), len(sizes)),
        (lambda done: run_sweep(solved, runs, places, done), len(runs)),
        (lambda done: run_sweep(planned, promises, places, done), len(promises)),
    ):
        ended = swept(run, total, quiet=quiet)
        if ended is not Exit.VERIFIED:
            return ended
    study = Study(Speed(sized, solved, limit), Plans(planned))
    made = tables(study)
    print_tables(made, as_json=as_json)
    written = [*write_study(study, output, made), *pictured(lambda: draw(study, output), quiet=quiet)]
    if not quiet:
        wrote_into(output, written)
    return Exit.VERIFIED

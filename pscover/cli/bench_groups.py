"""`pscover bench groups`: time against the number of overlapping groups, the paper's third experiment."""

from __future__ import annotations

from pathlib import Path

import click

from pscover.cli.bench_table2 import checked_engines, draw
from pscover.cli.fail import Exit
from pscover.cli.options import json_option, names, quiet_option, whole_numbers
from pscover.cli.output import wrote_into
from pscover.cli.sweeping import checked_limit, output_option, print_tables, swept, write_tables
from pscover.cli.workers import worker_options, workers

FIGURE = "groups.svg"
MOST = 12


@click.command("groups", short_help="Time against overlapping groups, the paper's third experiment.")
@output_option
@click.option("--seeds", type=click.IntRange(1, 1000), default=5, show_default=True, help="Scenes of each number of groups.")
@click.option(
    "--groups",
    type=whole_numbers,
    default=",".join(map(str, range(1, MOST + 1))),
    show_default=True,
    metavar="N,...",
    help="How many groups of three garments, any two of which overlap.",
)
@click.option("--engines", type=names, metavar="B/F,...", help="As of `pscover bench table2`.")
@click.option("--limit", type=float, default=20.0, show_default=True, metavar="SECONDS", help="Of CPU, for each engine.")
@worker_options
@json_option
@quiet_option
def command(
    output: Path,
    seeds: int,
    groups: tuple[int, ...],
    engines: tuple[str, ...] | None,
    limit: float,
    jobs: int,
    scheduler: str | None,
    as_json: bool,
    quiet: bool,
) -> Exit:
    """Measure whether times depend on how many of 35 garments overlap, as in the paper's third experiment.

    Scenes, engines, clock and folder are those of `pscover bench table2`.

    \b
    Examples:
      pscover bench groups -o groups/
      pscover bench groups --groups 1,4,8,12 --seeds 3 --jobs 2 -o groups/
    """
    from pscover.errors import InvalidSettings
    from pscover.evidence.growth import ENGINES, FULL, Case, sweep
    from pscover.evidence.sweep import Store, run_sweep
    from pscover.evidence.table2 import group_table, lines, trend_table

    for number in groups:
        if not 0 <= number <= MOST:
            raise InvalidSettings(f"--groups: expected whole numbers from 0 to {MOST}, got {number}")
    measures = sweep("groups", checked_limit(limit))
    chosen = checked_engines(engines or ENGINES)
    cases = [
        Case(garments=FULL, groups=number, seed=seed, engines=chosen)
        for number in sorted(set(groups))
        for seed in range(seeds)
    ]
    store, places = Store(output, measures), workers(jobs, scheduler)
    ended = swept(lambda done: run_sweep(store, cases, places, done), len(cases), quiet=quiet)
    if ended is not Exit.VERIFIED:
        return ended
    found = lines(store)
    tables = [group_table(found, limit), trend_table(found)]
    print_tables(tables, as_json=as_json)
    written = [*write_tables(tables, output), *draw(found, {}, limit, output / FIGURE, quiet=quiet)]
    if not quiet:
        wrote_into(output, written)
    return Exit.VERIFIED

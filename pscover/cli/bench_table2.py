"""`pscover bench table2`: time against the number of garments, beside the paper's Table 2."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pscover.cli.fail import Exit
from pscover.cli.options import json_option, names, quiet_option, whole_numbers
from pscover.cli.output import wrote_into
from pscover.cli.sweeping import checked_limit, output_option, pictured, print_tables, swept, write_tables
from pscover.cli.workers import worker_options, workers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pscover.evidence.growth import Case, Seen
    from pscover.evidence.table2 import Line

FIGURE = "table2.svg"
PAPERS = (5, 10, 15, 20, 25, 30, 35)
BEYOND = (50, 100, 200, 500, 1000)
MOST = 5000
SECOND, NONE = "mobile-sam", "none"


@click.command("table2", short_help="Time against garments, beside the paper's Table 2.")
@output_option
@click.option("--seeds", type=click.IntRange(1, 1000), default=5, show_default=True, help="Scenes of each size.")
@click.option(
    "--garments",
    type=whole_numbers,
    default=",".join(map(str, PAPERS)),
    show_default=True,
    metavar="N,...",
    help=f"Sizes; {','.join(map(str, BEYOND))} go beyond the paper's, on a larger table.",
)
@click.option(
    "--engines",
    type=names,
    metavar="B/F,...",
    help="BACKEND/FORMULATION; by default scipy/pairwise, highs/clique and auto/clique.",
)
@click.option(
    "--segmenters",
    type=names,
    metavar="NAME,...",
    help="Others than classical, which only look; by default mobile-sam where its weights are found, none for no others.",
)
@click.option("--limit", type=float, default=20.0, show_default=True, metavar="SECONDS", help="Of CPU, for each engine.")
@worker_options
@json_option
@quiet_option
def command(
    output: Path,
    seeds: int,
    garments: tuple[int, ...],
    engines: tuple[str, ...] | None,
    segmenters: tuple[str, ...] | None,
    limit: float,
    jobs: int,
    scheduler: str | None,
    as_json: bool,
    quiet: bool,
) -> Exit:
    """Measure how segmentation, candidates and engines grow with the garments, and set the paper's Table 2 beside.

    Scenes are painted, segmented for real, and every engine solves what was seen. Times are CPU seconds on one thread. An
    engine that reaches its limit at one size is left out of larger ones. DIR gets one line a case: after a kill or Ctrl-C
    the same command goes on where it was. More sizes or seeds may be added later.

    \b
    Examples:
      pscover bench table2 -o table2/
      pscover bench table2 --garments 5,20,35,100 --seeds 3 --jobs 2 -o table2/
    """
    from pscover.evidence.growth import ENGINES, Case, climb, sweep
    from pscover.evidence.sweep import Store, run_sweep
    from pscover.evidence.table2 import CLASSICAL, growth_table, lines, size_table

    _check_sizes(garments)
    measures, asked = sweep("table2", checked_limit(limit)), _segmenters(segmenters)
    chosen = checked_engines(engines or ENGINES)
    store = Store(output, measures)
    places, sizes = workers(jobs, scheduler), sorted(set(garments))
    looking = [
        Case(garments=size, seed=seed, segmenter=name, engines=())
        for name in asked
        for size in sizes
        if size <= max(PAPERS)
        for seed in range(seeds)
    ]

    def everything(done: Callable[[Case, Seen], None]) -> None:
        measured = climb(store, sizes, range(seeds), chosen, places, done)
        run_sweep(store, looking, places, done)
        store.sort([*measured, *looking])

    ended = swept(everything, len(sizes) * seeds + len(looking), quiet=quiet)
    if ended is not Exit.VERIFIED:
        return ended
    found = lines(store)
    lookers = dict.fromkeys(case.segmenter for case in store.cases if case.segmenter != CLASSICAL)
    others = {name: lines(store, name) for name in lookers}
    tables = [size_table(found, limit, others), growth_table(found)]
    print_tables(tables, as_json=as_json)
    written = [*write_tables(tables, output), *draw(found, others, limit, output / FIGURE, quiet=quiet)]
    if not quiet:
        wrote_into(output, written)
    return Exit.VERIFIED


def checked_engines(engines: Sequence[str]) -> tuple[str, ...]:
    """The same, once each; raises if one is no BACKEND/FORMULATION that there is, or lacks a package."""
    from pscover import registry
    from pscover.evidence.timed import Engine

    for engine in map(Engine.parse, engines):
        registry.backend(engine.backend)
        registry.formulation(engine.formulation)
    return tuple(dict.fromkeys(engines))


def _check_sizes(garments: Sequence[int]) -> None:
    from pscover.errors import InvalidSettings

    for size in garments:
        if not 1 <= size <= MOST:
            raise InvalidSettings(f"--garments: expected whole numbers from 1 to {MOST}, got {size}")


def _segmenters(asked: tuple[str, ...] | None) -> tuple[str, ...]:
    from pscover import registry
    from pscover.evidence.table2 import CLASSICAL

    if asked is None:
        return (SECOND,) if _is_ready(SECOND) else ()
    chosen = dict.fromkeys(registry.lookup("segmenter", name).name for name in asked if name != NONE)
    return tuple(name for name in chosen if name != CLASSICAL)


def _is_ready(segmenter: str) -> bool:
    """Whether its packages are installed and its weights are found."""
    from pscover import registry
    from pscover.perception.models import DECODER, ENCODER, find

    return not registry.missing(registry.lookup("segmenter", segmenter)) and bool(find(ENCODER) and find(DECODER))


def draw(
    found: Sequence[Line], others: Mapping[str, Sequence[Line]], limit: float, path: Path, *, quiet: bool
) -> list[Path]:
    """The figure, where matplotlib is installed."""

    def drawn() -> Path:
        from pscover.figures.growth import save_growth_figure

        save_growth_figure(found, others, limit, path)
        return path

    return pictured(drawn, quiet=quiet)

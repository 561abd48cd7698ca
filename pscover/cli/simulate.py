"""`pscover simulate`: policies on the same simulated scenes, in a table beside the paper's."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import Exit, say
from pscover.cli.live import advancing
from pscover.cli.options import FILE, json_option, known, names, parameter_option, quiet_option
from pscover.cli.output import wrote_into

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from pscover.experiment.statistics import Row
    from pscover.experiment.trial import Outcome, Trial

ALL = "all"
FIGURE = "policies.png"


@click.command("simulate", short_help="Let policies clear simulated tables, and compare them with the paper's.")
@click.option(
    "--policy",
    "policies",
    type=names,
    default="segment",
    show_default=True,
    metavar="NAME,...",
    help="Names with commas between them, or all.",
    shell_complete=known("policy"),
)
@click.option("--episodes", type=click.IntRange(1, 100_000), default=25, show_default=True, help="Scenes for each policy.")
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True, help="Of the first scene.")
@click.option("--output", "-o", type=FILE, required=True, metavar="DIR", help="Folder of the results; a run goes on there.")
@click.option("--jobs", "-j", type=click.IntRange(1, 256), default=1, show_default=True, help="Processes.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on the workers of a Dask scheduler instead.")
@click.option(
    "--world",
    type=click.Choice(("cloth", "tabletop")),
    default="cloth",
    show_default=True,
    help="Simulated cloth, or flat garments without physics.",
)
@click.option(
    "--segmenter", default="classical", show_default=True, metavar="NAME", help="What finds garments; truth: the true ones."
)
@parameter_option("--set-policy", "options", "policy")
@click.option("--baskets", type=names, metavar="CLASS,...", help="Sort: white, dark and coloured laundry, a basket each.")
@click.option("--predictor", type=FILE, metavar="FILE", help="Fitted by `pscover calibrate`; by default the paper's.")
@click.option(
    "--empty-below",
    type=float,
    default=0.0,
    show_default=True,
    metavar="KILOGRAMS",
    help="Picks that weigh less are not carried; 0 carries all, as the paper's robot did.",
)
@click.option("--most-transports", type=int, default=200, show_default=True, help="Trips after which an episode ends.")
@click.option("--film", type=FILE, metavar="GIF", help="Film the episode from above; for one policy and one episode.")
@click.option("--record", is_flag=True, help="Keep every episode's images and events in DIR/records.")
@json_option
@quiet_option
def command(
    policies: tuple[str, ...],
    episodes: int,
    seed: int,
    output: Path,
    jobs: int,
    scheduler: str | None,
    world: Any,
    segmenter: str,
    options: tuple[tuple[str, str], ...],
    baskets: tuple[str, ...] | None,
    predictor: Path | None,
    empty_below: float,
    most_transports: int,
    film: Path | None,
    record: bool,
    as_json: bool,
    quiet: bool,
) -> Exit:
    """Let policies clear the same simulated scenes, count garments and trips, and set the averages beside the paper's.

    The scene of an episode follows from its number alone, so that policies are compared scene by scene. DIR gets one file an
    episode, written whole: after a kill or Ctrl-C the same command goes on where it was and ends with the same tables.
    What the computer's speed decides is kept apart, in timing.csv.

    \b
    Examples:
      pscover simulate --policy all --episodes 25 --jobs 2 -o results/
      pscover simulate --policy random,segment --world tabletop -o quick/
      pscover simulate --policy segment --set-policy required=0.9 -o careful/
      pscover simulate --policy segment --episodes 1 --film episode.gif -o filmed/
    """
    from pscover.evidence import executors as places
    from pscover.execution.declutter import PATIENCE
    from pscover.experiment.batch import run_all, trials
    from pscover.experiment.statistics import rows
    from pscover.experiment.store import Store
    from pscover.experiment.tables import write_results
    from pscover.experiment.trial import Trial, policy_of, run
    from pscover.experiment.worlds import check_world

    chosen = _chosen(policies)
    if baskets:
        options = (*options, ("baskets", json.dumps(_classes(baskets))))
    _check_options(chosen, options)
    base = Trial(
        policy=chosen[0],
        options=tuple(sorted(options)),
        world=world,
        segmenter=segmenter,
        cache=str(output / "scenes") if world == "cloth" else "",
        record=str(output / "records") if record else "",
        predictor=None if predictor is None else _predictor(predictor),
        patience=replace(PATIENCE, empty_kilograms=empty_below, most_transports=most_transports),
    )
    listed = trials(base, chosen, range(seed, seed + episodes))
    for trial in listed[: len(chosen)]:
        policy_of(trial)
    check_world(world)
    _check_segmenter(base)
    if film is not None and (len(listed) > 1 or world != "cloth"):
        raise click.UsageError("--film: expected one policy, --episodes 1 and --world cloth")
    store = Store.of(output, base)
    if base.cache:
        Path(base.cache).mkdir(exist_ok=True)
    outcomes: dict[tuple[str, int], Outcome] = {}

    if film is not None:
        # Anew, even if the episode is kept already; what is kept stays the same.
        store.save(*run(replace(listed[0], film=str(film))))

    def executors() -> AbstractContextManager[Executor]:
        return places.cluster(scheduler) if scheduler else places.processes(jobs)

    with advancing(len(listed), quiet=quiet) as advance:

        def done(outcome: Outcome) -> None:
            outcomes[outcome.policy, outcome.seed] = outcome
            advance(f"{outcome.policy}, scene {outcome.seed}: {outcome.removed} garments in {outcome.trips} trips")

        try:
            run_all(listed, store, executors, done)
        except KeyboardInterrupt:
            say(f"interrupted after {len(outcomes)} of {len(listed)} episodes; the same command goes on with the rest")
            return Exit.INTERRUPTED
    ordered = [outcomes[policy, trial.seed] for policy in chosen for trial in listed if trial.policy == policy]
    table = rows(ordered)
    written = write_results(store, ordered, table)
    _print(table, as_json=as_json)
    written += _draw(table, output / FIGURE, quiet=quiet)
    if not quiet:
        for row in table:
            if row.stand_ins:
                say(f"note: {row.policy} failed or saw nothing to do in {row.stand_ins:.1f} trips an episode: random grasps")
        wrote_into(output, written)
    return Exit.VERIFIED


def _chosen(policies: tuple[str, ...]) -> list[str]:
    from pscover import registry

    asked = registry.names("policy") if ALL in policies else policies
    return list(dict.fromkeys(registry.lookup("policy", name).name for name in asked))


def _classes(baskets: tuple[str, ...]) -> tuple[str, ...]:
    from pscover.errors import UnknownName
    from pscover.execution.sorting import CLASSES

    for name in baskets:
        if name not in CLASSES:
            raise UnknownName.among("class of laundry", name, CLASSES)
    return tuple(dict.fromkeys(baskets))


def _check_options(chosen: Sequence[str], options: Sequence[tuple[str, str]]) -> None:
    """A setting is for those of the policies that have it; one that none has is a mistake."""
    from pscover import registry
    from pscover.errors import UnknownName

    settings = {name for policy in chosen for name in registry.policy_settings(policy)}
    for name, _ in options:
        if name not in settings:
            raise UnknownName.among(f"setting of {', '.join(chosen)}", name, settings)


def _check_segmenter(trial: Trial) -> None:
    from pscover import registry
    from pscover.experiment.worlds import TRUTH

    if trial.segmenter != TRUTH:
        registry.lookup("segmenter", trial.segmenter)


def _predictor(path: Path) -> Any:
    from pscover.grasping.calibrated import read_predictor

    return read_predictor(path)


def _print(table: list[Row], *, as_json: bool) -> None:
    import dataclasses

    from pscover.cli.output import show, show_document
    from pscover.cli.tables import grid
    from pscover.experiment.tables import NARROW, cells

    if as_json:
        show_document({"policies": [dataclasses.asdict(row) for row in table]})
        return
    shown = grid(*((head, "right" if head != "policy" else "left") for head in NARROW))
    for row in table:
        shown.add_row(*(cells(row)[head] for head in NARROW))
    show(shown)


def _draw(table: list[Row], path: Path, *, quiet: bool) -> list[Path]:
    from pscover.errors import MissingDependency

    try:
        from pscover.figures.policies import save_policies_figure

        save_policies_figure(table, path)
    except MissingDependency as missing:
        if not quiet:
            say(f"note: no picture: {missing}")
        return []
    return [path]

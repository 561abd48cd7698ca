"""`pscover calibrate`: fit the predictor's numbers to recorded grasps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pscover.cli.fail import Exit, say
from pscover.cli.options import FILE, json_option, quiet_option

if TYPE_CHECKING:
    from pscover.calibration.fit import Pairs
    from pscover.grasping.calibrated import Calibrated


@click.command("calibrate", short_help="Fit the grasp predictor to recorded grasps.")
@click.argument("records", metavar="DIR", type=FILE)
@click.option("--output", "-o", type=FILE, required=True, metavar="FILE", help="Write the predictor to a .json file.")
@click.option(
    "--model",
    type=click.Choice(("best", "ellipse", "logistic")),
    default="best",
    show_default=True,
    help="The ellipse of fitted size, its extension by more features, or whichever foretells better.",
)
@click.option(
    "--held-out",
    type=click.FloatRange(0.0, 1.0, min_open=True, max_open=True),
    default=0.25,
    show_default=True,
    help="Share of the episodes to test with.",
)
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True, help="Of the choice of these.")
@click.option("--test", type=FILE, metavar="DIR", help="Fit to all episodes, and test with the records below this folder.")
@click.option("--figure", type=FILE, metavar="FILE", help="Draw how reliable the predictors are (.png, .svg, .pdf).")
@json_option
@quiet_option
def command(
    records: Path,
    output: Path,
    model: str,
    held_out: float,
    seed: int,
    test: Path | None,
    figure: Path | None,
    as_json: bool,
    quiet: bool,
) -> Exit:
    """Fit the predictor to the grasps in the records below DIR, by maximum likelihood, and test it on episodes held out.

    A garment counts as removed when most of its pixels changed in the picture after the trip: nobody has to label
    anything. Any policy that plans by segments takes the result as --predictor. Episodes that several policies began with
    the same scene belong on one side: keep those to test with in a folder of their own, and name it with --test.

    \b
    Examples:
      pscover simulate --policy segment-replan --episodes 20 --record -o results/
      pscover calibrate results/records -o predictor.json --figure reliability.png
      pscover simulate --policy segment --predictor predictor.json -o fitted/
    """
    import msgspec

    from pscover.calibration.fit import PAPER, fit_ellipse, fit_logistic, pairs
    from pscover.calibration.logged import folders, logged, split
    from pscover.cli.output import require_distinct, require_writable, wrote
    from pscover.files import write_bytes

    require_distinct(output, figure)
    require_writable(output, suffixes=(".json",))
    require_writable(figure, suffixes=(".png", ".svg", ".pdf"))
    grasps = list(logged(folders(records)))
    if test is None:
        fitting, testing = split(grasps, held_out, seed)
    else:
        fitting, testing = grasps, list(logged(folders(test)))
        grasps = [*fitting, *testing]
    ellipse = fit_ellipse(fitting)
    fitted = {"paper": PAPER, "ellipse": ellipse, "logistic": fit_logistic(fitting, ellipse)}
    trained = {name: pairs(fitting, predictor) for name, predictor in fitted.items()}
    tested = {name: pairs(testing, predictor) for name, predictor in fitted.items()}
    chosen = min(("ellipse", "logistic"), key=lambda name: tested[name].log_loss) if model == "best" else model
    write_bytes(output, msgspec.json.format(msgspec.json.encode(fitted[chosen]), indent=2) + b"\n")
    episodes = len({grasp.episode for grasp in grasps})
    _print(fitted, trained, tested, chosen, episodes, len(grasps), as_json=as_json)
    if figure is not None:
        from pscover.figures.reliability import save_reliability_figure

        save_reliability_figure(tested, figure)
    if not quiet:
        wrote(output, "the predictor")
        if figure is not None:
            wrote(figure, "the picture")
        if tested[chosen].log_loss > tested["paper"].log_loss:
            say("note: on the episodes held out, the paper's numbers foretell better; record more episodes")
    return Exit.VERIFIED


def _print(
    fitted: dict[str, Calibrated],
    trained: dict[str, Pairs],
    tested: dict[str, Pairs],
    chosen: str,
    episodes: int,
    grasps: int,
    *,
    as_json: bool,
) -> None:
    from pscover.cli.output import show, show_document
    from pscover.cli.tables import grid

    if as_json:
        import dataclasses

        models = {
            name: {
                **dataclasses.asdict(predictor),
                "log_loss": {"fitted": trained[name].log_loss, "held_out": tested[name].log_loss},
                "brier": {"fitted": trained[name].brier, "held_out": tested[name].brier},
            }
            for name, predictor in fitted.items()
        }
        show_document({"episodes": episodes, "grasps": grasps, "chosen": chosen, "models": models})
        return
    table = grid(
        *(("model", "left"), ("d1 cm", "right"), ("d2 cm", "right"), ("b cm²", "right")),
        *(("log loss", "right"), ("held out", "right"), ("Brier", "right")),
    )
    for name, predictor in fitted.items():
        sizes = (predictor.major_cm, predictor.minor_cm, predictor.half_cm2)
        losses = (trained[name].log_loss, tested[name].log_loss, tested[name].brier)
        mark = " *" if name == chosen else ""
        table.add_row(name + mark, *(f"{size:.2f}" for size in sizes), *(f"{loss:.4f}" for loss in losses))
    counted = f"{grasps} grasps of {episodes} episodes; {len(tested['paper'].removed)} pairs of grasp and garment held out"
    show(counted, "", table, "", "* written; log loss and Brier score: the lower the better")

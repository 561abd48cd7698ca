"""The pictures of Table 2 and of the third experiment: seconds against garments, or against groups."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING

from pscover.errors import MissingDependency
from pscover.evidence.table2 import PAPER, Line
from pscover.figures.style import FRAME, INK, MUTED, write_figure
from pscover.figures.style import PAPER as SHEET

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOKING = {"segmentation": "#4c78a8", "candidates": "#54a24b"}
OTHER_LOOKING = ("#b279a2", "#eeca3b", "#9d755d")
PLANNING = ("#e45756", "#f58518", "#4c78a8", "#54a24b", "#b279a2", "#72b7b2")
THEIRS = "#9aa0aa"
STEPS = (2, 5, 10, 20, 35, 50, 100, 200, 500, 1000, 2000, 5000)


def growth_figure(found: Sequence[Line], others: Mapping[str, Sequence[Line]], limit: float) -> Figure:
    """Draw what every stage takes, with bars of 95 % over seeds: looking on the left, planning on the right.

    Parameters
    ----------
    found
        Lines of one number of garments each (drawn on logarithmic axes), or all of one, by groups.
    others
        Lines by other segmenters.
    limit
        CPU seconds that an engine had.

    Raises
    ------
    MissingDependency
        Without matplotlib.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingDependency.for_extra("the picture of a bench", ["matplotlib"], "figures") from None
    by_groups = len({line.garments for line in found}) < 2 and len({line.groups for line in found}) > 1
    figure = Figure(figsize=(11, 5.6), dpi=100, facecolor=SHEET)
    left, right = (figure.add_axes((x, 0.2, 0.415, 0.61)) for x in (0.065, 0.565))
    for stage, colour in LOOKING.items():
        name = "segmentation, classical" if stage == "segmentation" else stage
        _curve(left, found, stage, name, colour, by_groups=by_groups)
    for (name, lines), colour in zip(others.items(), OTHER_LOOKING, strict=False):
        _curve(left, lines, "segmentation", f"segmentation, {name}", colour, by_groups=False)
    engines = list(dict.fromkeys(stage for line in found for stage in line.stages if stage not in LOOKING))
    for k, (engine, colour) in enumerate(zip(engines, PLANNING, strict=False)):
        _curve(right, found, engine, engine.replace("/", ", "), colour, by_groups=by_groups)
        _cut_off(right, found, engine, colour, aside=k, by_groups=by_groups)
    if not by_groups:
        _published(left, [paper.segmentation for paper in PAPER.values()], "segmentation, paper (SAM)")
        _published(right, [paper.milp for paper in PAPER.values()], "MILP, paper")
    cut = any(column.cut_off for line in found for column in line.stages.values())
    if cut:
        right.axhline(limit, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
        right.text(
            0.01, limit, f"limit {limit:g} s", transform=right.get_yaxis_transform(), va="bottom", fontsize=8, color=MUTED
        )
    for axes, title in ((left, "Looking"), (right, "Planning")):
        _style(axes, title, found, others, by_groups=by_groups)
    subject = f"groups of overlapping garments among {found[0].garments}" if by_groups and found else "garments"
    figure.text(0.02, 0.935, f"Seconds against {subject}", fontsize=15, fontweight="bold", color=INK)
    seeds = " to ".join(dict.fromkeys(str(pick(line.seeds for line in found)) for pick in (min, max))) if found else "no"
    said = f"CPU seconds, one thread; means of {seeds} seeds, bars of 95 % by bootstrap over seeds"
    if cut:
        said += "; open triangles: cut off"
    figure.text(0.02, 0.885, said, fontsize=9.5, color=MUTED)
    return figure


def save_growth_figure(
    found: Sequence[Line], others: Mapping[str, Sequence[Line]], limit: float, path: str | PathLike[str]
) -> None:
    """Write the picture, whole or not at all; the suffix says which kind.

    Raises
    ------
    InvalidSettings
        For another suffix than .png, .svg or .pdf.
    MissingDependency
        Without matplotlib.
    PscoverError
        If the file cannot be written.
    """
    write_figure(path, lambda: growth_figure(found, others, limit))


def _curve(axes: Axes, found: Sequence[Line], stage: str, name: str, colour: str, *, by_groups: bool) -> None:
    places = [line.groups if by_groups else line.garments for line in found if stage in line.stages]
    columns = [line.stages[stage] for line in found if stage in line.stages]
    # A size at which a seed was cut off has no mean: the line breaks there.
    means = [math.nan if column.cut_off else column.mean.mean for column in columns]
    low = [mean - column.mean.low for mean, column in zip(means, columns, strict=True)]
    high = [column.mean.high - mean for mean, column in zip(means, columns, strict=True)]
    axes.errorbar(
        *(places, means),
        yerr=(low, high),
        color=colour,
        label=name,
        marker="o",
        markersize=4.5,
        linewidth=1.7,
        capsize=2.5,
        zorder=3,
    )


def _cut_off(axes: Axes, found: Sequence[Line], stage: str, colour: str, *, aside: int, by_groups: bool) -> None:
    """Triangles at the limit, moved a little to the right for each engine before, so that all of them show."""
    cut = [line for line in found if stage in line.stages and line.stages[stage].cut_off]
    places = [line.groups + 0.18 * aside if by_groups else line.garments * 1.05**aside for line in cut]
    axes.plot(
        *(places, [line.stages[stage].limit for line in cut]),
        linestyle="none",
        marker="^",
        markersize=8,
        markerfacecolor=SHEET,
        markeredgecolor=colour,
        zorder=4,
    )


def _published(axes: Axes, seconds: Sequence[float], name: str) -> None:
    axes.plot(list(PAPER), seconds, color=THEIRS, label=name, marker="s", markersize=4, linewidth=1.4, zorder=2)


def _style(axes: Axes, title: str, found: Sequence[Line], others: Mapping[str, Sequence[Line]], *, by_groups: bool) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if by_groups else (1,), numticks=14))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    if by_groups:
        axes.set_xticks([line.groups for line in found])
        axes.set_xlabel("groups", fontsize=9.5, color=MUTED)
    else:
        sizes = [line.garments for line in found] + list(PAPER)
        axes.set_xscale("log")
        axes.set_xlim(0.85 * min(sizes), 1.18 * max(sizes))
        shown = [step for step in STEPS if min(sizes) <= step <= max(sizes)]
        axes.set_xticks(shown, [str(step) for step in shown])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel("garments", fontsize=9.5, color=MUTED)
    axes.set_title(title, loc="left", fontsize=11, color=INK, fontweight="bold")
    axes.set_ylabel("seconds", fontsize=9.5, color=MUTED)
    axes.grid(visible=True, color=FRAME, linewidth=0.6, zorder=0)
    axes.tick_params(colors=MUTED, labelsize=9, which="both", length=0)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.legend(frameon=False, fontsize=8.5, labelcolor=INK, loc="upper left", ncols=3, bbox_to_anchor=(-0.02, -0.13))

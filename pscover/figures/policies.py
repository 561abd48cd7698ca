"""The picture of an experiment: objects per transport of each policy, beside the paper's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING

from pscover.errors import MissingDependency
from pscover.experiment.published import TABLE_1
from pscover.experiment.statistics import Interval, Row
from pscover.figures.style import INK, MUTED, PAPER, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OURS, THEIRS = "#4c78a8", "#b8bcc4"
ROW, HEAD, FOOT = 0.55, 1.15, 0.95
"""Inches of a policy, above and below."""


def policies_figure(rows: Sequence[Row]) -> Figure:
    """Draw objects per transport with 95 % intervals: bars of the experiment, and under each the paper's.

    Raises
    ------
    MissingDependency
        Without matplotlib.

    Examples
    --------
    >>> from pscover.experiment.statistics import rows
    >>> from pscover.experiment.trial import Trial, run
    >>> figure = policies_figure(rows([run(Trial(policy="random", world="tabletop"))[0]]))
    >>> [label.get_text() for label in figure.axes[0].get_yticklabels()]
    ['random']
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingDependency.for_extra("the picture of an experiment", ["matplotlib"], "figures") from None
    tall = HEAD + FOOT + ROW * max(1, len(rows))
    figure = Figure(figsize=(9, tall), dpi=100, facecolor=PAPER)
    axes = figure.add_axes((0.16, FOOT / tall, 0.8, ROW * max(1, len(rows)) / tall))
    for place, row in enumerate(rows):
        _bar(axes, place - 0.17, row.opt, OURS, bold=True)
        paper = TABLE_1.get(row.policy)
        if paper is not None:
            low, high = paper.opt - paper.bound, paper.opt + paper.bound
            _bar(axes, place + 0.19, Interval(mean=paper.opt, low=low, high=high), THEIRS, bold=False)
    _style(axes, rows)
    figure.text(0.02, 1 - 0.36 / tall, "Objects per transport", fontsize=16, fontweight="bold", color=INK)
    counts = sorted({row.episodes for row in rows})
    scenes = " or ".join(map(str, counts)) if counts else "no"
    said = f"{scenes} episodes a policy, the same scenes for all; bars of 95 % by bootstrap over scenes"
    figure.text(0.02, 1 - 0.68 / tall, said, fontsize=10, color=MUTED)
    _legend(figure)
    return figure


def save_policies_figure(rows: Sequence[Row], path: str | PathLike[str]) -> None:
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
    write_figure(path, lambda: policies_figure(rows))


def _bar(axes: Axes, place: float, interval: Interval, colour: str, *, bold: bool) -> None:
    if math.isnan(interval.mean):
        return
    axes.barh(place, interval.mean, height=0.34 if bold else 0.26, color=colour, zorder=2)
    axes.plot((interval.low, interval.high), (place, place), color=INK, linewidth=1.4, zorder=3)
    axes.text(
        max(interval.mean, interval.high) + 0.025,
        place,
        f"{interval.mean:.2f}",
        va="center_baseline",
        fontsize=9.5 if bold else 8,
        fontweight="bold" if bold else "normal",
        color=INK if bold else MUTED,
    )


def _style(axes: Axes, rows: Sequence[Row]) -> None:
    axes.set_yticks(range(len(rows)), [row.policy for row in rows], fontsize=10.5, color=INK)
    axes.set_ylim(max(1, len(rows)) - 0.45, -0.55)
    axes.set_xlim(left=0)
    axes.margins(x=0.12)
    axes.axvline(1.0, color=MUTED, linewidth=0.8, linestyle=(0, (3, 3)), zorder=1)
    axes.set_xlabel("garments removed / trips to the basket, those with nothing included", fontsize=9.5, color=MUTED)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", colors=MUTED, labelsize=9)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)


def _legend(figure: Figure) -> None:
    from matplotlib.patches import Patch

    keys = [Patch(color=OURS, label="this experiment"), Patch(color=THEIRS, label="Adler et al. 2023, Table 1, on a robot")]
    figure.legend(handles=keys, loc="lower left", bbox_to_anchor=(0.15, 0.0), ncols=2, frameon=False, fontsize=9.5)

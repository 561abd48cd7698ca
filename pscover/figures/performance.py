"""The picture of who solves how much how fast: a performance profile, and the share solved within seconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING

from pscover.errors import MissingDependency
from pscover.evidence.study.profile import RESOLUTION, Profile, performance, within
from pscover.figures.style import FRAME, INK, MUTED, PAPER, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#e45756", "#4c78a8", "#54a24b", "#f58518", "#b279a2", "#2f8f9d", "#9d755d", "#eeca3b")
DASHES = ("-", (0, (4, 2)), (0, (1, 1.5)))


def performance_figure(times: Mapping[tuple[str, str], Sequence[float]], limit: float) -> Figure:
    """Draw both: on the left the ratio to the fastest, on the right seconds; axes of x are logarithmic.

    Parameters
    ----------
    times
        Seconds of each (formulation, engine), one an instance, in the same order for all; infinite where it was not solved.
        Engines are told by colours, formulations by dashes.
    limit
        CPU seconds that each had.

    Raises
    ------
    MissingDependency
        Without matplotlib.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingDependency.for_extra("the picture of a study", ["matplotlib"], "figures") from None
    figure = Figure(figsize=(11, 5.2), dpi=100, facecolor=PAPER)
    left, right = (figure.add_axes((x, 0.13, width, 0.67)) for x, width in ((0.06, 0.36), (0.47, 0.36)))
    named = {f"{engine}, {formulation}": own for (formulation, engine), own in times.items()}
    styles = dict(zip(named, _styles(list(times)), strict=True))
    ratios, seconds = performance(named), within(named)
    slowest = max((profile.at[-1] for profile in ratios.values() if profile.at), default=1.0)
    _curves(left, ratios, styles, 1.0, 1.15 * slowest)
    _curves(right, seconds, styles, RESOLUTION, limit)
    left.set_title("Within a factor of the fastest", loc="left", fontsize=11, color=INK, fontweight="bold")
    right.set_title("Within seconds", loc="left", fontsize=11, color=INK, fontweight="bold")
    left.set_xlabel("CPU seconds / those of the fastest on the instance", fontsize=9.5, color=MUTED)
    right.set_xlabel("CPU seconds", fontsize=9.5, color=MUTED)
    left.set_ylabel("share of instances solved and proven", fontsize=9.5, color=MUTED)
    count = len(next(iter(named.values()), ()))
    figure.text(0.02, 0.935, "Who proves plans, and how fast", fontsize=15, fontweight="bold", color=INK)
    said = f"{count} instances, one thread, {limit:g} CPU seconds; times below {RESOLUTION:g} s count as that"
    figure.text(0.02, 0.885, said, fontsize=9.5, color=MUTED)
    figure.legend(
        *right.get_legend_handles_labels(), loc="center left", bbox_to_anchor=(0.84, 0.47), frameon=False, fontsize=9
    )
    return figure


def save_performance_figure(
    times: Mapping[tuple[str, str], Sequence[float]], limit: float, path: str | PathLike[str]
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
    write_figure(path, lambda: performance_figure(times, limit))


def _styles(pairs: Sequence[tuple[str, str]]) -> list[dict[str, object]]:
    """A colour for each engine, dashes for each formulation."""
    engines = list(dict.fromkeys(engine for _, engine in pairs))
    formulations = list(dict.fromkeys(formulation for formulation, _ in pairs))
    return [
        {
            "color": COLOURS[engines.index(engine) % len(COLOURS)],
            "linestyle": DASHES[formulations.index(formulation) % len(DASHES)],
        }
        for formulation, engine in pairs
    ]


def _curves(
    axes: Axes, profiles: Mapping[str, Profile], styles: Mapping[str, dict[str, object]], start: float, stop: float
) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for name, profile in profiles.items():
        # From the left edge to the right one: a staircase has no value between its steps but that of the last.
        x = [start, *profile.at, max(stop, *profile.at)] if profile.at else [start, stop]
        y = [profile.value(start), *profile.share, profile.share[-1]] if profile.at else [0.0, 0.0]
        axes.step(x, y, where="post", label=name, linewidth=1.8, zorder=3, **styles[name])
    axes.set_xscale("log")
    axes.set_xlim(start, stop)
    axes.set_ylim(0.0, 1.02)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(visible=True, color=FRAME, linewidth=0.6, zorder=0)
    axes.tick_params(colors=MUTED, labelsize=9, which="both", length=0)
    for side in axes.spines.values():
        side.set_visible(False)

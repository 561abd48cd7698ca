"""The picture of how reliable predictors are: what they foretold against what happened."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from pscover.calibration.fit import Pairs
from pscover.errors import MissingDependency
from pscover.figures.style import INK, MUTED, PAPER, palette, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 10


def reliability_figure(tested: dict[str, Pairs]) -> Figure:
    """Draw, for each predictor, the share of garments removed among those with about the same probability.

    Parameters
    ----------
    tested
        What each predictor foretold of the same grasps.

    Raises
    ------
    MissingDependency
        Without matplotlib.

    Examples
    --------
    >>> found = Pairs(probability=np.array([0.1, 0.8, 0.9]), removed=np.array([False, True, True]))
    >>> [axes.get_title(loc="left") for axes in reliability_figure({"mine": found}).axes]
    ['mine: log loss 0.145']
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingDependency.for_extra("the picture of a predictor", ["matplotlib"], "figures") from None
    figure = Figure(figsize=(3.4 * max(1, len(tested)) + 0.6, 4.5), dpi=100, facecolor=PAPER)
    across = 3.4 * max(1, len(tested)) + 0.6
    colours = palette(len(tested))
    for place, (name, found) in enumerate(tested.items()):
        axes = figure.add_axes(((0.6 + 3.4 * place) / across, 0.6 / 4.5, 2.9 / across, 2.9 / 4.5))
        _panel(axes, name, found, tuple(colours[place]), is_first=place == 0)
    figure.text(0.12 / across, 4.18 / 4.5, "What was foretold, and what happened", fontsize=14, fontweight="bold", color=INK)
    return figure


def save_reliability_figure(tested: dict[str, Pairs], path: str | PathLike[str]) -> None:
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
    write_figure(path, lambda: reliability_figure(tested))


def _panel(axes: Axes, name: str, found: Pairs, colour: tuple[float, ...], *, is_first: bool) -> None:
    bins = np.minimum((found.probability * BINS).astype(int), BINS - 1)
    count = np.bincount(bins, minlength=BINS)
    used = count > 0
    foretold = np.bincount(bins, weights=found.probability, minlength=BINS)[used] / count[used]
    happened = np.bincount(bins, weights=found.removed, minlength=BINS)[used] / count[used]
    axes.plot((0, 1), (0, 1), color=MUTED, linewidth=0.9, linestyle=(0, (3, 3)))
    axes.plot(foretold, happened, color=colour, linewidth=1.4, zorder=2)
    sizes = 12 + 260 * count[used] / count.sum()
    axes.scatter(foretold, happened, s=sizes, color=[colour], edgecolors="white", linewidths=0.8, zorder=3)
    for x, y, k in zip(foretold, happened, count[used], strict=True):
        axes.annotate(str(k), (x, y), (0, 9), textcoords="offset points", ha="center", fontsize=7.5, color=MUTED)
    axes.set_title(f"{name}: log loss {found.log_loss:.3f}", loc="left", fontsize=10.5, color=INK)
    axes.set_xlim(-0.03, 1.03)
    axes.set_ylim(-0.03, 1.09)
    axes.set_xlabel("probability", fontsize=9.5, color=MUTED)
    if is_first:
        axes.set_ylabel("share removed", fontsize=9.5, color=MUTED)
    axes.tick_params(colors=MUTED, labelsize=8.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)

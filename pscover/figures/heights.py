"""Heights above the table as part of other pictures: the map with its scale, and how high each garment lies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pscover.figures.style import INK, MUTED, bare, draw_outlines
from pscover.perception.depth import HeightMap
from pscover.scene import Scene
from pscover.seen import Seen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

COLOURS = "viridis"
"""Even steps of height look even, in print and to the colour-blind too."""
SHOWN = 99.8
"""Percentile of the heights at which the scale ends; higher ones, often wrong ones, share its last colour."""
STEPS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100)
"""Centimetres at which a scale may end."""
LISTED = 45
NAMED = 18


def top_of_scale(heights: HeightMap) -> float:
    """Centimetres at which the scale of a height map ends.

    Examples
    --------
    >>> from pscover.perception.depth import height_map
    >>> from pscover.perception.table_plane import TablePlane
    >>> top_of_scale(height_map(np.full((9, 9), 0.97), table=TablePlane.level(1)))
    3
    """
    highest = 100 * float(np.percentile(heights.metres, SHOWN))
    return next((step for step in STEPS if step >= highest - 0.05), math.ceil(highest / 100) * 100)


def draw_heights(view: Axes, scene: Scene, heights: HeightMap) -> AxesImage:
    """The map over the scene's extent, with the outlines of the garments."""
    image = view.imshow(
        100 * heights.metres, cmap=COLOURS, vmin=0, vmax=top_of_scale(heights), interpolation="antialiased", zorder=0
    )
    count = scene.garments
    draw_outlines(view, scene, np.zeros((count, 3)), 2.2)
    draw_outlines(view, scene, np.ones((count, 3)), 0.9)
    bare(view)
    return image


def draw_scale(axes: Axes, image: AxesImage, heights: HeightMap) -> None:
    """The colour bar, in centimetres; pointed where some pixels are higher."""
    from matplotlib.figure import Figure

    beyond = 100 * float(heights.metres.max()) > image.get_clim()[1] + 0.05
    assert isinstance(axes.figure, Figure)
    bar = axes.figure.colorbar(image, cax=axes, extend="max" if beyond else "neither")
    bar.ax.tick_params(labelsize=9.5, length=3, colors=INK)
    bar.set_label("cm above the table", fontsize=10.5, color=INK)
    bar.outline.set_visible(False)


def draw_bars(panel: Axes, seen: Seen, colours: NDArray[np.float64]) -> None:
    """How high each garment lies: a bar to its mean, a mark at its top."""
    garments, count = seen.garment_heights or (), seen.scene.garments
    rows, size = np.arange(count), 9.5 if count <= 20 else 7.0
    means, tops = [100 * garment.mean for garment in garments], [100 * garment.top for garment in garments]
    longest = max(tops, default=0.0) or 1.0
    panel.barh(rows, [longest] * count, height=0.62, color="#f1f3f5", zorder=0)
    panel.barh(rows, means, height=0.62, color=colours, zorder=1)
    for row in range(count):
        panel.plot((tops[row],) * 2, (row - 0.42, row + 0.42), color=INK, linewidth=1.6, zorder=2, clip_on=False)
        text = f"{means[row]:.1f}, top {tops[row]:.1f}"
        panel.text(1.03 * longest, row, text, va="center_baseline", fontsize=size, color=MUTED)
    names = [name if len(name) <= NAMED else name[: NAMED - 1] + "…" for name in seen.scene.names]
    labels: dict[str, Any] = {"fontsize": size, "color": INK}
    panel.set_yticks(rows, names, **labels)
    for label in panel.get_yticklabels():
        # Names are the user's: a dollar sign in one starts no formula.
        label.set_parse_math(False)
    panel.set_xticks([])
    panel.tick_params(length=0)
    panel.set_xlim(0, longest)
    panel.set_ylim(max(count, 8) - 0.5, -0.5)
    for spine in panel.spines.values():
        spine.set_visible(False)

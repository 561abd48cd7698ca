"""The picture of a scene: the photo with every segment in its colour, outlined and numbered, and a list of them."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings, MissingDependency
from pscover.figures.heights import LISTED, draw_bars, draw_heights, draw_scale
from pscover.figures.style import INK, MUTED, PAPER, bare, check_format, draw_outlines, kind_of, palette, rendered
from pscover.files import write_bytes
from pscover.scene import Scene
from pscover.seen import Seen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SURFACE = (0.945, 0.937, 0.918)
NUMBERED = 200
"""More segments than this get no numbers in the picture."""
GAP, HEAD, FOOT, LINE = 0.12, 0.5, 0.18, 0.22
"""Inches between panels, above each, below all, and of a line of text there."""
BAR = 0.75
"""Inches that the colour bar takes beside a height map."""


def scene_figure(seen: Seen, width: int = 1200) -> Figure:
    """Draw the photo, and beside it the segments with their labels.

    Parameters
    ----------
    seen
        What to show. Without a photo only the map of the labels is drawn; with depth, the heights and those of each segment.
    width
        In pixels of a PNG, at 100 pixels an inch.

    Raises
    ------
    InvalidSettings
        If the width is not from 400 to 10000.
    MissingDependency
        Without matplotlib.

    Examples
    --------
    >>> figure = scene_figure(Seen.whole(Scene.of(np.ones((60, 90), dtype=int))))
    >>> figure.axes[0].get_title(loc="left"), [text.get_text() for text in figure.axes[0].texts]
    ('1 segment', ['1'])
    """
    if not 400 <= width <= 10_000:
        raise InvalidSettings(f"width: expected 400 to 10000 pixels, got {width!r}")
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingDependency.for_extra("the picture of a scene", ["matplotlib"], "figures") from None
    scene, heights = seen.scene, seen.heights
    panels = 1 + (scene.photo is not None) + (heights is not None)
    said = (seen.origin,) if heights is None else (seen.origin, seen.depth_origin)
    sheet = Sheet.of(scene, width, panels, rows=1 if panels < 3 else 2, foot=FOOT + LINE * len(said))
    figure = Figure(figsize=(sheet.across, sheet.tall), dpi=100, facecolor=PAPER)
    colours = palette(scene.garments)
    if scene.photo is not None:
        photo = figure.add_axes(sheet.place(0))
        photo.imshow(scene.photo, interpolation="antialiased")
        bare(photo)
        photo.set_anchor("NW")
        _titled(photo, "photo")
    view = figure.add_axes(sheet.place(panels - 1 if heights is None else panels - 2))
    view.imshow(tinted(scene, colours), interpolation="nearest" if scene.photo is None else "antialiased")
    draw_outlines(view, scene, 0.62 * colours)
    _number(view, scene)
    bare(view)
    view.set_anchor("N" if panels == 1 else "NW")
    _titled(view, f"{scene.garments} segment" if scene.garments == 1 else f"{scene.garments} segments")
    if heights is not None:
        _heights(figure, sheet, seen, colours, panels - 1)
    for row, line in enumerate(reversed(said)):
        at = (0.15 + LINE * row) / sheet.tall
        figure.text(GAP / sheet.across, at, line, fontsize=9.5, color=MUTED, parse_math=False, va="center")
    return figure


@dataclass(frozen=True, slots=True)
class Sheet:
    """Panels of one size in rows; all numbers are inches."""

    across: float
    tall: float
    each: float
    picture: float
    columns: int
    rows: int
    foot: float

    @classmethod
    def of(cls, scene: Scene, width: int, panels: int, rows: int, foot: float) -> Sheet:
        """A sheet for so many panels of the scene's shape."""
        across, columns = width / 100, -(-panels // rows)
        each = (across - GAP * (columns + 1)) / columns
        picture = float(np.clip(each * scene.shape[0] / scene.shape[1], 1.0, 1.6 * across / rows))
        return cls(across, rows * (picture + HEAD) + foot, each, picture, columns, rows, foot)

    def place(self, panel: int, left: float = 0.0, wide: float | None = None) -> tuple[float, float, float, float]:
        """Where a panel lies, or a part of it `left` from its left edge and `wide`, in shares of the figure."""
        row, column = divmod(panel, self.columns)
        x = GAP + column * (self.each + GAP) + left
        y = self.foot + (self.rows - 1 - row) * (self.picture + HEAD)
        width = self.each if wide is None else wide
        return x / self.across, y / self.tall, width / self.across, self.picture / self.tall


def _heights(figure: Figure, sheet: Sheet, seen: Seen, colours: NDArray[np.float64], panel: int) -> None:
    """The height map with its scale, and, where a panel is left, how high each segment lies."""
    heights, (rows, columns) = seen.heights, seen.scene.shape
    assert heights is not None
    wide = min(sheet.each, sheet.picture * columns / rows)
    if sheet.rows == 1 and wide > sheet.each - BAR:
        wide = sheet.each - BAR
    view = figure.add_axes(sheet.place(panel, wide=wide))
    image = draw_heights(view, seen.scene, heights)
    view.set_anchor("NW")
    _titled(view, "height")
    left, bottom, across, tall = sheet.place(panel, left=wide + 0.1, wide=0.16)
    high = wide * rows / columns / sheet.tall
    draw_scale(figure.add_axes((left, bottom + max(0.0, tall - high), across, min(high, tall))), image, heights)
    if sheet.rows > 1 and 0 < seen.scene.garments <= LISTED:
        margin = BAR + 1.1
        bars = figure.add_axes(sheet.place(panel + 1, left=margin, wide=sheet.each - margin - 1.1))
        draw_bars(bars, seen, colours)
        _titled(bars, "mean height and top, cm")


def render_scene(seen: Seen, kind: str = "png", width: int = 1200) -> bytes:
    """The picture as the content of a PNG, SVG or PDF file.

    Raises
    ------
    InvalidSettings
        For another kind of file.
    MissingDependency
        Without matplotlib.
    """
    check_format(kind)
    return rendered(scene_figure(seen, width), kind)


def save_scene_figure(seen: Seen, path: str | PathLike[str], width: int = 1200) -> None:
    """Write the picture to a file, whole or not at all; the suffix says which kind.

    Raises
    ------
    InvalidSettings
        For another suffix than .png, .svg or .pdf.
    MissingDependency
        Without matplotlib.
    PscoverError
        If the file cannot be written.
    """
    write_bytes(path, render_scene(seen, kind_of(path), width))


def tinted(scene: Scene, colours: NDArray[np.float64]) -> NDArray[np.float64]:
    """The photo with every segment in its colour, folds and shadows kept; or the map of labels. RGB from 0 to 1."""
    on = scene.segments >= 0
    own = colours[scene.segments[on]]
    if scene.photo is None:
        ground = np.full((*scene.shape, 3), SURFACE)
        ground[on] += 0.55 * (own - ground[on])
        return ground
    ground = scene.photo / 255.0
    # The photo's own hue under a tint makes mud: garments keep their light and dark only.
    light = ground[on] @ (0.299, 0.587, 0.114)
    ground[on] = 0.5 * own + 0.5 * (0.2 + 0.8 * light[:, None])
    ground[~on] = 0.85 * ground[~on] + 0.15
    return ground


def middles(scene: Scene) -> NDArray[np.float64]:
    """A point (x, y) well inside each segment, as far from its rim as any, shape (garments, 2).

    Examples
    --------
    >>> middles(Scene.of([[1, 1, 1], [1, 1, 1], [1, 1, 1]])).tolist()
    [[1.0, 1.0]]
    """
    from scipy import ndimage

    points = np.zeros((scene.garments, 2))
    for j, (rows, columns) in enumerate(ndimage.find_objects(scene.segments + 1, max_label=scene.garments)):
        inner = ndimage.distance_transform_edt(np.pad(scene.segments[rows, columns] == j, 1))
        y, x = np.unravel_index(int(inner.argmax()), inner.shape)
        points[j] = x - 1 + columns.start, y - 1 + rows.start
    return points


def _number(view: Axes, scene: Scene) -> None:
    if scene.garments > NUMBERED:
        return
    box: dict[str, Any] = {"boxstyle": "round,pad=0.25", "facecolor": INK, "edgecolor": "white", "linewidth": 1}
    for (x, y), value in zip(middles(scene).tolist(), scene.values.tolist(), strict=True):
        view.text(
            x,
            y,
            str(value),
            ha="center",
            va="center_baseline",
            fontsize=9,
            fontweight="bold",
            color="white",
            bbox=box,
            zorder=5,
        )


def _titled(view: Axes, title: str) -> None:
    view.set_title(title, loc="left", fontsize=14, fontweight="bold", color=INK, pad=8)

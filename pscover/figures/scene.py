"""The picture of a scene: the photo with every segment in its colour, outlined and numbered, and a list of them."""

from __future__ import annotations

import io
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings, MissingDependency
from pscover.files import write_bytes
from pscover.scene import Scene
from pscover.seen import Seen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
PAPER, INK, MUTED = "#ffffff", "#1f2430", "#6b7280"
SURFACE = (0.945, 0.937, 0.918)
NUMBERED = 200
"""More segments than this get no numbers in the picture."""
COLOURS = (
    *("#4c78a8", "#f58518", "#54a24b", "#e45756", "#72b7b2", "#b279a2"),
    *("#eeca3b", "#7f6bb3", "#ff9da6", "#9d755d", "#2f8f9d", "#a3b84a"),
)
"""Of garments; further ones repeat them darker and lighter."""


def palette(count: int) -> NDArray[np.float64]:
    """Colours of garments, shape (count, 3), RGB from 0 to 1.

    Examples
    --------
    >>> palette(2).round(2).tolist()
    [[0.3, 0.47, 0.66], [0.96, 0.52, 0.09]]
    """
    given = np.array([[int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)] for colour in COLOURS])
    round_, which = np.divmod(np.arange(count), len(COLOURS))
    shade = np.array([0.0, -0.25, 0.3])[round_ % 3][:, None]
    mixed: NDArray[np.float64] = given[which] * (1 - np.abs(shade)) + np.clip(shade, 0, 1)
    return mixed


def scene_figure(seen: Seen, width: int = 1200) -> Figure:
    """Draw the photo, and beside it the segments with their labels.

    Parameters
    ----------
    seen
        What to show. Without a photo only the map of the labels is drawn.
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
    scene = seen.scene
    panels = 1 if scene.photo is None else 2
    height = scene.shape[0] / scene.shape[1]
    across, gap, head, foot = width / 100, 0.12, 0.5, 0.4
    each = (across - gap * (panels + 1)) / panels
    picture = float(np.clip(each * height, 1.0, 1.6 * across))
    tall = picture + head + foot
    figure = Figure(figsize=(across, tall), dpi=100, facecolor=PAPER)
    views = [
        figure.add_axes(((gap + k * (each + gap)) / across, foot / tall, each / across, picture / tall))
        for k in range(panels)
    ]
    for view in views:
        view.set_anchor("N" if panels == 1 else "NW")
        view.set_xticks([])
        view.set_yticks([])
        for spine in view.spines.values():
            spine.set_color("#d4d4d8")
    if scene.photo is not None:
        views[0].imshow(scene.photo, interpolation="antialiased")
        _titled(views[0], "photo")
    colours = palette(scene.garments)
    views[-1].imshow(tinted(scene, colours), interpolation="nearest" if scene.photo is None else "antialiased")
    draw_outlines(views[-1], scene, colours)
    _number(views[-1], scene)
    _titled(views[-1], f"{scene.garments} segment" if scene.garments == 1 else f"{scene.garments} segments")
    figure.text(gap / across, 0.15 / tall, seen.origin, fontsize=9.5, color=MUTED, parse_math=False, va="center")
    return figure


def check_format(kind: str) -> None:
    """Raise `InvalidSettings` for a kind of file that no picture is written as."""
    if kind not in FORMATS:
        raise InvalidSettings(f"picture: expected one of {', '.join(FORMATS)}, got {kind!r}")


def rendered(figure: Figure, kind: str) -> bytes:
    """A figure as the content of a file of one of `FORMATS`, without a date: drawing it again is no change."""
    content = io.BytesIO()
    dated = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}[kind]
    figure.savefig(content, format=kind, metadata=dated)
    return content.getvalue()


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
    write_bytes(path, render_scene(seen, Path(path).suffix.lower().removeprefix("."), width))


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


def draw_outlines(view: Axes, scene: Scene, colours: NDArray[np.float64]) -> None:
    """A line around every segment, in its colour."""
    from scipy import ndimage

    for j, (rows, columns) in enumerate(ndimage.find_objects(scene.segments + 1, max_label=scene.garments)):
        mask = np.pad(scene.segments[rows, columns] == j, 1).astype(float)
        x = np.arange(columns.start - 1, columns.stop + 1)
        y = np.arange(rows.start - 1, rows.stop + 1)
        view.contour(x, y, mask, levels=[0.5], colors=[tuple(0.62 * colours[j])], linewidths=1.4, zorder=2)


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

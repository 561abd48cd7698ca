"""The picture of a plan: garments, parts, candidates, and the chosen grasps numbered in order of execution."""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings, MissingDependency
from pscover.figures.heights import LISTED, draw_heights, draw_scale
from pscover.figures.scene import tinted
from pscover.figures.style import INK, MUTED, PAPER, bare, check_format, draw_outlines, kind_of, palette, rendered
from pscover.files import write_bytes
from pscover.grasping.partition import partition
from pscover.perception.depth import HeightMap
from pscover.planning import Plan
from pscover.result import Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ALARM = "#c2255c"
NAMED = 18
"""Characters of a garment's name that are shown."""
HEAD, FOOT = 1.05, 0.5
"""Inches above and below the picture."""
BELOW, BETWEEN = 0.72, 0.75
"""Width of the height map below the picture, in the figure's, and the inches between the two."""
ROW, WIDEST_ROW = 0.15, 0.3
"""Inches of a line of the list, at least and at most."""
BASKET = "#f59f00"
MANY = 60
"""More grasps than this get small numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanStyle:
    """How the picture looks.

    Parameters
    ----------
    width
        In pixels of a PNG, at 100 pixels an inch.

    Raises
    ------
    InvalidSettings
        If a number is outside its domain.
    """

    width: int = 1200

    def __post_init__(self) -> None:
        if not 400 <= self.width <= 10_000:
            raise InvalidSettings(f"width: expected 400 to 10000 pixels, got {self.width!r}")


STYLE = PlanStyle()


def plan_figure(plan: Plan, style: PlanStyle = STYLE) -> Figure:
    """Draw a plan over its photo, or over a map of the labels if the scene has no photo.

    Parameters
    ----------
    plan
        What to show.
    style
        How it looks.

    Returns
    -------
    matplotlib.figure.Figure
        Made without pyplot, so that threads can draw at the same time.

    Raises
    ------
    MissingDependency
        Without matplotlib.

    Examples
    --------
    >>> from pscover.planning import plan
    >>> figure = plan_figure(plan(np.ones((60, 90), dtype=int)))
    >>> figure.axes[0].get_title(loc="left")
    '1 grasp for 1 garment'
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingDependency.for_extra("the picture of a plan", ["matplotlib"], "figures") from None
    listed = 0 < plan.scene.garments <= LISTED
    height, width = plan.scene.shape
    across = style.width / 100
    share = 0.73 if listed else 0.95
    picture = max(min(across * (share - 0.01) * height / width, 1.4 * across), ROW * plan.scene.garments * listed, 2.0)
    below = 0.0 if plan.seen.heights is None else min(across * BELOW * height / width, across) + BETWEEN
    tall = picture + below + HEAD + FOOT
    figure = Figure(figsize=(across, tall), dpi=100, facecolor=PAPER)
    low, high = (FOOT + below) / tall, picture / tall
    view = figure.add_axes((0.025, low, share - 0.01, high))
    colours = palette(plan.scene.garments)
    _draw_scene(view, plan, colours)
    _draw_grasps(view, plan)
    _draw_basket(view, plan)
    _title(view, plan)
    if listed:
        _draw_list(figure.add_axes((0.855, low, 0.105, high)), plan, colours, slots=picture / WIDEST_ROW)
    if plan.seen.heights is not None:
        _draw_heights(figure, plan, plan.seen.heights, (below - BETWEEN) / tall)
    _legend(figure, plan)
    return figure


def render_plan(plan: Plan, kind: str = "png", style: PlanStyle = STYLE) -> bytes:
    """The picture as the content of a PNG, SVG or PDF file.

    Raises
    ------
    InvalidSettings
        For another kind of file.
    MissingDependency
        Without matplotlib.
    """
    check_format(kind)
    return rendered(plan_figure(plan, style), kind)


def save_plan_figure(plan: Plan, path: str | PathLike[str], style: PlanStyle = STYLE) -> None:
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
    write_bytes(path, render_plan(plan, kind_of(path), style))


def headline(plan: Plan) -> tuple[str, str, str]:
    """The title, what is proven, and the figures."""
    grasps, garments = len(plan.grasps), plan.scene.garments
    status = plan.status
    if status is Status.OPTIMAL:
        proof = f"optimal: no plan from {plan.scope} needs fewer grasps"
    elif status is Status.FEASIBLE and math.isfinite(plan.bound):
        proof = f"feasible: every plan from {plan.scope} needs at least {plan.bound:g}"
    elif status is Status.FEASIBLE:
        proof = "feasible: how many are needed is not known"
    elif status is Status.INFEASIBLE:
        proof = f"the requirement of {_counted(len(plan.unmet), 'garment')} is out of reach: the plan that comes closest"
    else:
        proof = f"{_counted(len(plan.unmet), 'garment')} left short: no plan that meets every requirement was found in time"
    figures = (
        f"{plan.expected_removed:.1f} garments expected in the basket",
        f"{plan.scope.poses:,} {'candidates' if plan.scope.candidates == 'sampled' else 'poses'}",
        f"{plan.seen.seconds + plan.seconds.candidates + plan.seconds.solve:.2f} s",
    )
    return f"{_counted(grasps, 'grasp')} for {_counted(garments, 'garment')}", proof, "   ·   ".join(figures)


def _counted(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _title(view: Axes, plan: Plan) -> None:
    title, proof, figures = headline(plan)
    view.set_title(title, loc="left", fontsize=20, fontweight="bold", color=INK, pad=45)
    places: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "annotation_clip": False}
    view.annotate(proof, (0, 1), (0, 28), fontsize=11.5, color=ALARM if plan.unmet else INK, **places)
    view.annotate(figures, (0, 1), (0, 10), fontsize=10.5, color=MUTED, **places)


def _draw_scene(view: Axes, plan: Plan, colours: NDArray[np.float64]) -> None:
    """Photo or map, garments, the boundaries of parts, candidates."""
    scene = plan.scene
    height, width = scene.shape
    smooth = "nearest" if scene.photo is None else "antialiased"
    view.imshow(tinted(scene, colours), interpolation=smooth, zorder=0)
    _draw_boundaries(view, plan)
    draw_outlines(view, scene, 0.62 * colours)
    poses = plan.instance.meta.poses
    if poses is not None and len(poses):
        points = np.unique(poses[:, :2], axis=0)
        size = 5.0 if len(points) < 4000 else 1.0
        view.scatter(points[:, 0], points[:, 1], s=size, c="white", edgecolors="#00000090", linewidths=0.35, zorder=3)
    view.set_xlim(-0.5, width - 0.5)
    view.set_ylim(height - 0.5, -0.5)
    view.set_anchor("NW")
    bare(view)


def _draw_boundaries(view: Axes, plan: Plan) -> None:
    """Thin lines between pixels of one garment that belong to different parts."""
    from matplotlib.collections import LineCollection

    parts, segments = partition(plan.scene, plan.sampling.reach).parts, plan.scene.segments
    y, x = np.nonzero((parts[:, 1:] != parts[:, :-1]) & (segments[:, 1:] == segments[:, :-1]))
    upright = np.stack((np.stack((x + 0.5, y - 0.5), axis=1), np.stack((x + 0.5, y + 0.5), axis=1)), axis=1)
    y, x = np.nonzero((parts[1:] != parts[:-1]) & (segments[1:] == segments[:-1]))
    level = np.stack((np.stack((x - 0.5, y + 0.5), axis=1), np.stack((x + 0.5, y + 0.5), axis=1)), axis=1)
    lines = np.concatenate((upright, level))
    view.add_collection(LineCollection(list(lines), colors="white", linewidths=0.6, alpha=0.42, zorder=1))


def _draw_grasps(view: Axes, plan: Plan) -> None:
    """The chosen ellipses with the axis along the jaw, numbered in order of execution."""
    from matplotlib.patches import Ellipse
    from matplotlib.patheffects import withStroke

    major, minor = plan.axes
    halo = [withStroke(linewidth=3.2, foreground="white")]
    many = len(plan.grasps) > MANY
    for number, grasp in enumerate(plan.grasps, start=1):
        at = plan.seen.grid.from_photo(grasp.x, grasp.y)
        ellipse = Ellipse(at, major, minor, angle=math.degrees(grasp.theta), zorder=5)
        ellipse.set(facecolor="#ffffff59", edgecolor=INK, linewidth=1.4, path_effects=halo)
        view.add_patch(ellipse)
        dx, dy = math.cos(grasp.theta) * major / 2, math.sin(grasp.theta) * major / 2
        view.plot((at[0] - dx, at[0] + dx), (at[1] - dy, at[1] + dy), color=INK, linewidth=1, zorder=6)
        view.annotate(
            str(number),
            at,
            ha="center",
            va="center_baseline",
            fontsize=5 if many else 8.5,
            fontweight="bold",
            color="white",
            zorder=7,
            bbox={"boxstyle": "circle,pad=0.22", "facecolor": INK, "edgecolor": "white", "linewidth": 1},
        )


def _draw_heights(figure: Figure, plan: Plan, heights: HeightMap, high: float) -> None:
    """The same extent again, by height, with the numbers of the grasps; the scale beside it."""
    across, tall = figure.get_size_inches()
    rows, columns = plan.scene.shape
    low, wide = FOOT / tall, min(BELOW, high * tall * columns / rows / across)
    view = figure.add_axes((0.025, low, wide, high))
    image = draw_heights(view, plan.scene, heights)
    draw_scale(figure.add_axes((0.025 + wide + 0.01, low, 0.014, high)), image, heights)
    view.set_title("height above the table", loc="left", fontsize=13, fontweight="bold", color=INK, pad=24)
    places: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "annotation_clip": False}
    view.annotate(plan.seen.depth_origin, (0, 1), (0, 9), fontsize=9.5, color=MUTED, parse_math=False, **places)
    box: dict[str, Any] = {"boxstyle": "circle,pad=0.2", "facecolor": INK, "edgecolor": "white", "linewidth": 1}
    for number, grasp in enumerate(plan.grasps, start=1):
        at = plan.seen.grid.from_photo(grasp.x, grasp.y)
        text: dict[str, Any] = {"fontsize": 5 if len(plan.grasps) > MANY else 8, "fontweight": "bold", "color": "white"}
        view.annotate(str(number), at, ha="center", va="center_baseline", bbox=box, zorder=7, **text)


def _draw_basket(view: Axes, plan: Plan) -> None:
    """Where garments are taken, or the nearest point of the picture."""
    height, width = plan.scene.shape
    x, y = plan.scene.basket
    inside = (min(max(x, 0), width - 1), min(max(y, 0), height - 1))
    view.plot(*inside, marker="D", markersize=13, color=BASKET, markeredgecolor=INK, clip_on=False, zorder=8)


def _draw_list(panel: Axes, plan: Plan, colours: NDArray[np.float64], slots: float) -> None:
    """How surely each garment is removed, beside what is required."""
    count = plan.scene.garments
    rows, size = np.arange(count), 9.5 if count <= 25 else 8.0
    names = [name if len(name) <= NAMED else name[: NAMED - 1] + "…" for name in plan.scene.names]
    panel.barh(rows, np.ones(count), height=0.62, color="#f1f3f5", zorder=0)
    panel.barh(rows, plan.coverage, height=0.62, color=colours, zorder=1)
    required = plan.instance.required
    for row in range(count):
        panel.plot((required[row], required[row]), (row - 0.42, row + 0.42), color=INK, linewidth=1.3, zorder=2)
    short = set(plan.unmet)
    for row, covered in enumerate(plan.coverage):
        panel.text(1.05, row, f"{covered:.2f}", va="center_baseline", fontsize=size, color=ALARM if row in short else MUTED)
    panel.set_yticks(rows, names, fontsize=size)
    for j, label in enumerate(panel.get_yticklabels()):
        # Names are the user's: a dollar sign in one starts no formula.
        label.set_parse_math(False)
        label.set_color(ALARM if j in short else INK)
        label.set_fontweight("bold" if j in short else "normal")
    panel.tick_params(length=0)
    panel.set_xticks([])
    panel.set_xlim(0, 1)
    panel.set_ylim(max(count, slots) - 0.5, -0.5)
    for spine in panel.spines.values():
        spine.set_visible(False)
    panel.set_title("probability of removal", fontsize=10.5, color=MUTED, loc="right", pad=10)


def _legend(figure: Figure, plan: Plan) -> None:
    from matplotlib.lines import Line2D

    (x, y), (height, width) = plan.scene.basket, plan.scene.shape
    basket = "basket" if 0 <= x < width and 0 <= y < height else "towards the basket"
    plain: dict[str, Any] = {"linestyle": "none"}
    keys = [
        Line2D([], [], marker="o", markersize=13, color=INK, label="grasp, in order of execution", **plain),
        Line2D([], [], marker="o", markersize=4, color="white", markeredgecolor=INK, label="candidate point", **plain),
        Line2D([], [], color="#adb5bd", linewidth=1.2, label="part: same garments within reach"),
        Line2D([], [], marker="D", markersize=9, color=BASKET, label=basket, **plain),
    ]
    if plan.scene.garments <= LISTED:
        keys.append(Line2D([], [], marker="|", markersize=12, markeredgewidth=1.6, color=INK, label="required", **plain))
    figure.legend(handles=keys, loc="lower left", bbox_to_anchor=(0.018, 0.0), ncols=5, frameon=False, fontsize=9.5)

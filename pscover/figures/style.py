"""What all figures have in common: ink, colours of garments, outlines, kinds of files."""

from __future__ import annotations

import io
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings
from pscover.files import write_bytes
from pscover.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
PAPER, INK, MUTED = "#ffffff", "#1f2430", "#6b7280"
FRAME = "#d4d4d8"
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


def check_format(kind: str) -> None:
    """Raise `InvalidSettings` for a kind of file that no picture is written as."""
    if kind not in FORMATS:
        raise InvalidSettings(f"picture: expected one of {', '.join(FORMATS)}, got {kind!r}")


def kind_of(path: str | PathLike[str]) -> str:
    """The kind of file that a path's suffix asks for.

    Raises
    ------
    InvalidSettings
        If no picture is written as that.

    Examples
    --------
    >>> kind_of("plans/Photo.PNG")
    'png'
    """
    kind = Path(path).suffix.lower().removeprefix(".")
    check_format(kind)
    return kind


def rendered(figure: Figure, kind: str) -> bytes:
    """A figure as the content of a file of one of `FORMATS`, without a date: drawing it again is no change."""
    content = io.BytesIO()
    dated = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}[kind]
    figure.savefig(content, format=kind, metadata=dated)
    return content.getvalue()


def write_figure(path: str | PathLike[str], draw: Callable[[], Figure]) -> None:
    """Draw a figure and write it, whole or not at all; a suffix that is none of a picture stops it before it is drawn."""
    kind = kind_of(path)
    write_bytes(path, rendered(draw(), kind))


def draw_outlines(view: Axes, scene: Scene, inks: NDArray[np.float64], width: float = 1.4) -> None:
    """A line around every segment, in the ink of its own, shape (garments, 3); widths in points."""
    from scipy import ndimage

    for j, (rows, columns) in enumerate(ndimage.find_objects(scene.segments + 1, max_label=scene.garments)):
        mask = np.pad(scene.segments[rows, columns] == j, 1).astype(float)
        x = np.arange(columns.start - 1, columns.stop + 1)
        y = np.arange(rows.start - 1, rows.stop + 1)
        view.contour(x, y, mask, levels=[0.5], colors=[tuple(inks[j])], linewidths=width, zorder=2)


def bare(view: Axes) -> None:
    """Neither ticks nor a black frame."""
    view.set_xticks([])
    view.set_yticks([])
    for spine in view.spines.values():
        spine.set_color(FRAME)

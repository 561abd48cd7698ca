"""A film as an animated GIF: frames from the overhead camera, with numbered grasps and a line of words on them."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pscover.errors import MissingDependency, PscoverError
from pscover.files import write_bytes
from pscover.robot import Frame, Pose

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

COLOURS = 128
"""In the palette, which all frames share: with one of its own each, pixels that rest would change."""
INK, NOW, PAPER = (31, 36, 48), (214, 40, 40), (255, 255, 255)
"""Of words and grasps to come; of grasps of the trip under way; of what is around them."""
BAND, DISC = 18, 8
"""Pixels: height of the line of words, radius of a number's disc."""
SAMPLES = 12
"""Frames from which the palette is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A grasp drawn over a frame.

    Parameters
    ----------
    number
        Written on it.
    pose
        Where, in pixels of the frame.
    now
        Whether it belongs to the trip under way.
    """

    number: int
    pose: Pose
    now: bool = False


@dataclass(slots=True, kw_only=True, eq=False)
class Strip:
    """Frames in order, each as long as it is shown.

    Parameters
    ----------
    jaw
        Length of the jaw in pixels: how long a grasp is drawn.
    seconds
        For which a frame is shown.
    aside
        Words at the right end of the line.
    marks, words
        Drawn on the frames that are shown from now on.

    Raises
    ------
    MissingDependency
        Without Pillow.

    Examples
    --------
    >>> strip = Strip(jaw=40, seconds=0.1)
    >>> strip.marks = (Mark(number=1, pose=Pose(x=50, y=30, theta=0.5)),)
    >>> strip.show(Frame(rgb=np.full((60, 100, 3), 200, dtype=np.uint8)))
    >>> strip.content()[:6]
    b'GIF89a'
    """

    jaw: float
    seconds: float
    aside: str = ""
    marks: Sequence[Mark] = ()
    words: str = ""
    _frames: list[Image] = field(default_factory=list)
    _milliseconds: list[int] = field(default_factory=list)
    _last: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        try:
            import PIL.Image  # noqa: F401
        except ImportError:
            raise MissingDependency.for_extra("an animation", ["pillow"], "perception") from None

    def show(self, frame: Frame) -> None:
        """Add a frame."""
        self._add(frame.rgb, self.seconds)

    def hold(self, seconds: float) -> None:
        """Show the last frame for so long, with the marks and words of now; nothing before the first frame."""
        if self._last is not None:
            self._add(self._last, seconds)

    def content(self) -> bytes:
        """The bytes of a GIF that repeats for ever.

        Raises
        ------
        PscoverError
            If there is no frame.
        """
        if not self._frames:
            raise PscoverError("animation: expected at least one frame, got none: nothing moved while it was filmed")
        from PIL import Image

        palette = self._palette()
        frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in self._frames]
        out = io.BytesIO()
        frames[0].save(
            out,
            format="GIF",
            save_all=True,
            append_images=frames[1:],
            duration=self._milliseconds,
            loop=0,
            optimize=False,
        )
        return out.getvalue()

    def save(self, path: str | PathLike[str]) -> None:
        """Write the GIF, whole or not at all.

        Raises
        ------
        PscoverError
            If there is no frame, or the file cannot be written.
        """
        write_bytes(path, self.content())

    def _palette(self) -> Image:
        """Colours of frames from the whole film, for what lies below is seen late."""
        from PIL import Image

        step = max(1, len(self._frames) // SAMPLES)
        some = np.concatenate([np.asarray(frame) for frame in self._frames[::step]])
        return Image.fromarray(some).quantize(COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)

    def _add(self, rgb: NDArray[np.uint8], seconds: float) -> None:
        from PIL import Image, ImageDraw

        self._last = rgb
        height, width = rgb.shape[:2]
        image = Image.new("RGB", (width, height + BAND), PAPER)
        image.paste(Image.fromarray(rgb))
        drawing = ImageDraw.Draw(image)
        for mark in self.marks:
            _draw(drawing, mark, self.jaw)
        drawing.text((4, height + BAND / 2), self.words, fill=INK, anchor="lm", font_size=12)
        drawing.text((width - 4, height + BAND / 2), self.aside, fill=INK, anchor="rm", font_size=12)
        self._frames.append(image)
        # Players take hundredths of a second, and show shorter frames for longer.
        self._milliseconds.append(max(20, 10 * round(100 * seconds)))


def _draw(drawing: ImageDraw, mark: Mark, jaw: float) -> None:
    pose, ink = mark.pose, NOW if mark.now else INK
    dx, dy = jaw / 2 * math.cos(pose.theta), jaw / 2 * math.sin(pose.theta)
    ends = (pose.x - dx, pose.y - dy, pose.x + dx, pose.y + dy)
    drawing.line(ends, fill=PAPER, width=5)
    drawing.line(ends, fill=ink, width=3)
    around = (pose.x - DISC, pose.y - DISC, pose.x + DISC, pose.y + DISC)
    drawing.ellipse(around, fill=ink, outline=PAPER)
    drawing.text((pose.x, pose.y), str(mark.number), fill=PAPER, anchor="mm", font_size=11)

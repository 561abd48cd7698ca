"""What a policy can ask of a frame: which pixels show cloth, which garments there are, how high they lie."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage
from pscover.execution.sorting import ByColour
from pscover.robot import Frame
from pscover.seen import Seen

if TYPE_CHECKING:
    from pscover.inputs import Look
    from pscover.perception.table_plane import Intrinsics, TablePlane

BoolImage = NDArray[np.bool_]
FloatImage = NDArray[np.float32]


class Eyes(Protocol):
    """From a frame to what it shows. Everything is in pixels of the frame, and a function of the frame alone."""

    @property
    def pixels_per_cm(self) -> float:
        """Scale of the frame."""
        ...

    @property
    def basket(self) -> tuple[float, float] | None:
        """Where garments are taken, (x, y); None for the middle of the frame's right edge."""
        ...

    def cloth(self, frame: Frame) -> BoolImage:
        """Which pixels show cloth, shape (H, W)."""
        ...

    def segments(self, frame: Frame) -> Seen:
        """The garments."""
        ...

    def heights(self, frame: Frame) -> FloatImage:
        """Metres above the table, shape (H, W)."""
        ...

    def classes(self, frame: Frame, seen: Seen) -> tuple[str, ...]:
        """The class of each garment of `seen`, for sorting."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoEyes:
    """Colour and depth, by `pscover.perception`.

    Parameters
    ----------
    look
        How photos are looked at: segmenter, background, region, scale, basket. By default the paper's scale and the
        segmenter `classical`.
    table
        The plane of the empty table; without it, it is found in each frame.
    camera
        Intrinsics, for heights perpendicular to the table under a camera that is not.
    sorting
        What tells the classes of garments apart.
    """

    look: Look = field(default_factory=lambda: _default_look())
    table: TablePlane | None = None
    camera: Intrinsics | None = None
    sorting: ByColour = field(default_factory=ByColour)

    @property
    def pixels_per_cm(self) -> float:
        """Scale of the frame."""
        return self.look.pixels_per_cm

    @property
    def basket(self) -> tuple[float, float] | None:
        """Where garments are taken."""
        return self.look.basket

    def cloth(self, frame: Frame) -> BoolImage:
        """The cloth map of the frame, or, where garments decide what is cloth, their union.

        Examples
        --------
        >>> rgb = np.full((40, 60, 3), 200, dtype=np.uint8)
        >>> rgb[10:30, 20:40] = 200, 0, 0
        >>> int(PhotoEyes().cloth(Frame(rgb=rgb)).sum())
        360
        """
        from pscover.perception.background import parse_background
        from pscover.perception.cloth import cloth_map
        from pscover.perception.grid import Grid
        from pscover.perception.roi import region

        look = self.look
        if look.settings.cloth.decision == "mask":
            return np.asarray(self.segments(frame).labels > 0)
        grid = Grid.over(frame.shape, pixels_per_cm=look.pixels_per_cm, pixel_limit=look.settings.pixel_limit)
        corners = [grid.from_photo(*corner) for corner in look.roi or ()]
        found = cloth_map(
            grid.scaled(frame.rgb),
            parse_background(look.background),
            inside=region(corners or None, grid.shape),
            grid=grid,
            settings=look.settings.cloth,
        )
        return grid.enlarged(found.cloth)

    def segments(self, frame: Frame) -> Seen:
        """What the segmenter finds; depth tells cloth too, where `perceive`'s settings ask for it."""
        if frame.depth is None or not self.look.settings.cloth_height_cm:
            return self.look.photo(frame.rgb)
        from pscover.perception.depth import Depth

        return self.look.photo(
            frame.rgb, depth=Depth(image=frame.depth, metres_per_unit=1.0, camera=self.camera, table=self.table)
        )

    def heights(self, frame: Frame) -> FloatImage:
        """Heights of the frame's depth.

        Raises
        ------
        InvalidImage
            Without depth, or if it measures too little.
        """
        from pscover.perception.depth import height_map

        if frame.depth is None:
            raise InvalidImage("frame: expected depth in metres, got none; use a policy that needs no depth camera")
        return height_map(frame.depth, metres_per_unit=1.0, camera=self.camera, table=self.table).metres

    def classes(self, frame: Frame, seen: Seen) -> tuple[str, ...]:
        """What the sorting says of each garment's pixels."""
        return self.sorting.classes(frame.rgb, seen)


def _default_look() -> Look:
    from pscover.inputs import Look

    return Look()


class Sight:
    """A frame, and what is seen in it: looked at when asked for, and once.

    Parameters
    ----------
    frame
        What the camera saw.
    eyes
        What looks at it.
    failed
        Points (x, y) where grasps have failed often enough.
    radius
        Pixels around these points in which no grasp is to be made.
    cloth
        Which pixels show cloth, if the eyes have said so of this frame already.

    Examples
    --------
    >>> from pscover.execution.tabletop import ColourEyes
    >>> rgb = np.full((30, 40, 3), 255, dtype=np.uint8)
    >>> rgb[5:15, 5:25] = 200, 0, 0
    >>> sight = Sight(Frame(rgb=rgb), ColourEyes(), failed=[(5, 10)], radius=10)
    >>> sight.seen.scene.garments, int(sight.cloth.sum()), int(sight.free.sum())
    (1, 200, 100)
    """

    def __init__(
        self,
        frame: Frame,
        eyes: Eyes,
        failed: Iterable[tuple[float, float]] = (),
        radius: float = 0.0,
        cloth: BoolImage | None = None,
    ) -> None:
        self.frame = frame
        self.eyes = eyes
        self.failed = tuple(failed)
        self.radius = radius
        if cloth is not None:
            self.cloth = cloth

    @cached_property
    def cloth(self) -> BoolImage:
        """Which pixels show cloth."""
        return self.eyes.cloth(self.frame)

    @cached_property
    def free(self) -> BoolImage:
        """Pixels of cloth where grasps may be tried."""
        allowed = self.cloth.copy()
        height, width = allowed.shape
        y, x = np.arange(height)[:, None], np.arange(width)
        for at_x, at_y in self.failed:
            allowed &= (x - at_x) ** 2 + (y - at_y) ** 2 > self.radius**2
        return allowed

    @cached_property
    def seen(self) -> Seen:
        """The garments."""
        return self.eyes.segments(self.frame)

    @cached_property
    def heights(self) -> FloatImage:
        """Metres above the table; 0 where the eyes do not know."""
        heights = self.eyes.heights(self.frame)
        return np.where(np.isfinite(heights), heights, np.float32(0))

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """The class of each garment."""
        return self.eyes.classes(self.frame, self.seen)

    @property
    def basket(self) -> tuple[float, float]:
        """Where garments are taken, (x, y) in pixels."""
        height, width = self.frame.shape
        return self.eyes.basket or (width - 1.0, (height - 1) / 2)

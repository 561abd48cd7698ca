"""What a planner needs of a camera and of an arm: the two protocols that one implements for one's own.

Places are pixels (x, y) of the camera's image: column x, row y, both from 0, x to the right and y down. The arm's own
coordinates, its calibration and its speeds stay behind these methods.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings


class RobotFailed(Exception):
    """For robots and cameras to raise when a motion or a capture failed and the next may succeed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """What the camera saw at one moment.

    Parameters
    ----------
    rgb
        Shape (H, W, 3), 8 bits. It is copied, so that a driver may fill one buffer again and again.
    depth
        Distance along the optical axis in metres, floating point, shape (H, W); NaN or 0 where it is unknown. None without a
        depth camera. Copied too.

    Raises
    ------
    InvalidImage
        If the shapes or the types are not these.

    Examples
    --------
    >>> Frame(rgb=np.zeros((282, 470, 3), dtype=np.uint8)).shape
    (282, 470)
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        rgb = _array(self.rgb, "rgb")
        if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8 or rgb.size == 0:
            raise InvalidImage(f"rgb: expected 8-bit RGB of shape (H, W, 3), got {rgb.dtype} {rgb.shape}")
        object.__setattr__(self, "rgb", _kept(rgb))
        if self.depth is None:
            return
        depth = _array(self.depth, "depth")
        if depth.shape != self.shape:
            raise InvalidImage(f"depth: expected the shape of the image, {self.shape}, got {depth.shape}")
        if depth.dtype.kind != "f":
            # Depth cameras count millimetres in whole numbers.
            raise InvalidImage(f"depth: expected metres in floating point, got {depth.dtype}; divide by the units a metre")
        object.__setattr__(self, "depth", _kept(depth))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.rgb.shape[:2]
        return rows, columns


def _array(image: object, name: str) -> NDArray[Any]:
    if not isinstance(image, np.ndarray):
        raise InvalidImage(f"{name}: expected a NumPy array, got {type(image).__name__}")
    return image


def _kept(image: NDArray[Any]) -> NDArray[Any]:
    own = image.copy()
    own.setflags(write=False)
    return own


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where the gripper closes, from above.

    Parameters
    ----------
    x, y
        Pixels of the camera's image.
    theta
        Orientation of the jaw's length in radians, from the x axis towards the y axis.

    Raises
    ------
    InvalidSettings
        If a number is not finite.
    """

    x: float
    y: float
    theta: float = 0.0

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.x, self.y, self.theta))):
            raise InvalidSettings(f"pose: expected finite numbers, got {self}")


@runtime_checkable
class Camera(Protocol):
    """Looks at the table from above, from one place throughout."""

    def capture(self) -> Frame:
        """What is seen now, with the arm out of the way; every frame has the same shape."""
        ...


@runtime_checkable
class Robot(Protocol):
    """An arm with a parallel jaw that can hold several garments at once."""

    def pick(self, pose: Pose) -> None:
        """Open, go down at the pose, close, and lift what is caught. What was held before a `place` lies there again."""
        ...

    def place(self, point: tuple[float, float]) -> None:
        """Take what is held to a point above the table, put it down and let go."""
        ...

    def transport(self) -> None:
        """Take what is held to the basket and let go."""
        ...

    def weight(self) -> float | None:
        """Kilograms that are held now, or None if the arm cannot tell."""
        ...


@runtime_checkable
class Sorter(Robot, Protocol):
    """An arm with several baskets."""

    def transport_to(self, basket: str) -> None:
        """Take what is held to the basket of that name and let go."""
        ...

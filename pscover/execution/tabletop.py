"""A table top of flat garments: a robot and a camera in milliseconds, for tests of policies and of one's own code.

There is no physics in it. The gripper takes whole every garment of which enough lies between its jaws, and each garment
has one colour of its own. It stands in for an arm, not for an experiment: for those, see `pscover.sim`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.execution.sight import Sight
from pscover.robot import Frame, Pose
from pscover.scene import Scene
from pscover.seen import Seen

BoolImage = NDArray[np.bool_]
SURFACE = (255, 255, 255)
JAW = (40.0, 10.0)
"""Length and opening of the jaw, in pixels."""
ENOUGH, DEEP = 40, 2
"""Pixels of a garment between the jaws from which it is taken, where it is among so many of the topmost layers."""
LAYER, CAMERA = 0.02, 1.3
"""Metres: of cloth, and from the camera to the table."""
KILOGRAMS = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourEyes:
    """Eyes for pictures in which the surface is white and every garment has one colour of its own.

    Parameters
    ----------
    pixels_per_cm
        Scale of the frame.
    basket
        Where garments are taken; by default the middle of the frame's right edge.
    kinds
        Classes of garments by their colours, as (red, green, blue, class); others are "".
    """

    pixels_per_cm: float = 4.7
    basket: tuple[float, float] | None = None
    kinds: tuple[tuple[int, int, int, str], ...] = ()

    def cloth(self, frame: Frame) -> BoolImage:
        """All that is not white."""
        return np.asarray((frame.rgb != SURFACE).any(axis=2))

    def segments(self, frame: Frame) -> Seen:
        """One garment a colour.

        Examples
        --------
        >>> rgb = np.full((2, 3, 3), 255, dtype=np.uint8)
        >>> rgb[0, 0], rgb[1, 1:] = (200, 0, 0), (0, 0, 200)
        >>> ColourEyes().segments(Frame(rgb=rgb)).scene.labels.tolist()
        [[2, 0, 0], [0, 1, 1]]
        """
        key = _keys(frame.rgb)
        values, index = np.unique(key, return_inverse=True)
        label = np.cumsum(values != _keys(np.array([SURFACE], dtype=np.uint8))[0])
        label[values == _keys(np.array([SURFACE], dtype=np.uint8))[0]] = 0
        labels = label[index.reshape(key.shape)]
        return Seen.whole(Scene.of(labels, pixels_per_cm=self.pixels_per_cm, basket=self.basket, photo=frame.rgb), "colours")

    def heights(self, frame: Frame) -> NDArray[np.float32]:
        """Metres above the table, whose distance from the camera is known."""
        if frame.depth is None:
            return np.where(self.cloth(frame), LAYER, 0.0).astype(np.float32)
        return np.asarray(np.maximum(CAMERA - frame.depth, 0), dtype=np.float32)

    def classes(self, frame: Frame, seen: Seen) -> tuple[str, ...]:
        """By `kinds`."""
        known = {(red, green, blue): kind for red, green, blue, kind in self.kinds}
        pixels = [frame.rgb[seen.scene.labels == value][0].tolist() for value in seen.scene.values]
        return tuple(known.get((red, green, blue), "") for red, green, blue in pixels)


def _keys(rgb: NDArray[np.uint8]) -> NDArray[np.int64]:
    wide = rgb.astype(np.int64)
    keys: NDArray[np.int64] = wide[..., 0] << 16 | wide[..., 1] << 8 | wide[..., 2]
    return keys


@dataclass(slots=True, kw_only=True, eq=False)
class Garment:
    """Where a garment lies, hidden pixels included, shape (H, W)."""

    label: int
    mask: BoolImage


@dataclass(slots=True, kw_only=True, eq=False)
class Tabletop:
    """A robot and a camera over a table of flat garments; build it with `Tabletop.of`.

    Parameters
    ----------
    shape
        Height and width in pixels.
    garments
        On the table, from the lowest to the topmost.
    held
        In the gripper.
    baskets
        What has been taken away: (basket, label), in order.
    """

    shape: tuple[int, int]
    garments: list[Garment]
    held: list[Garment] = field(default_factory=list)
    baskets: list[tuple[str, int]] = field(default_factory=list)

    @classmethod
    def of(cls, labels: ArrayLike | Scene, over: Sequence[BoolImage] = ()) -> Tabletop:
        """The garments of a label image side by side, and further ones, as masks, on top of them.

        Examples
        --------
        >>> table = Tabletop.of([[1, 1, 0], [2, 2, 0]], over=[np.array([[1, 0, 0], [1, 0, 0]], dtype=bool)])
        >>> table.labels.tolist()
        [[3, 1, 0], [3, 2, 0]]
        """
        image = labels.labels if isinstance(labels, Scene) else np.asarray(labels)
        values = [int(value) for value in np.unique(image) if value]
        garments = [Garment(label=value, mask=image == value) for value in values]
        first = max(values, default=0) + 1
        garments += [Garment(label=first + k, mask=mask) for k, mask in enumerate(over)]
        return cls(shape=(image.shape[0], image.shape[1]), garments=garments)

    @property
    def labels(self) -> NDArray[np.int32]:
        """What is seen from above, shape (H, W)."""
        image = np.zeros(self.shape, dtype=np.int32)
        for garment in self.garments:
            image[garment.mask] = garment.label
        return image

    def sight(self) -> Sight:
        """What is seen now, by eyes that know the colours."""
        return Sight(self.capture(), ColourEyes())

    def capture(self) -> Frame:
        """One colour a garment on white; depth by the number of layers."""
        labels = self.labels
        rgb = np.full((*self.shape, 3), SURFACE, dtype=np.uint8)
        for garment in self.garments:
            rgb[labels == garment.label] = colour(garment.label)
        layers = np.zeros(self.shape, dtype=np.float32)
        for garment in self.garments:
            layers += garment.mask
        return Frame(rgb=rgb, depth=(CAMERA - LAYER * layers).astype(np.float32))

    def pick(self, pose: Pose) -> None:
        """Take every garment of which enough lies between the jaws, in the topmost layers."""
        self.garments += self.held
        jaws = _jaws(pose, self.shape)
        above = np.zeros(int(jaws.sum()), dtype=np.int32)
        self.held = []
        for garment in reversed(self.garments):
            here = garment.mask[jaws]
            if int((here & (above < DEEP)).sum()) >= ENOUGH:
                self.held.append(garment)
            above += here
        self.garments = [garment for garment in self.garments if garment not in self.held]

    def place(self, point: tuple[float, float]) -> None:
        """Lay what is held on top, its middle at the point, all of it on the table."""
        for garment in self.held:
            garment.mask = _moved(garment.mask, point)
        self.garments += self.held
        self.held = []

    def transport(self) -> None:
        """Take what is held away."""
        self.transport_to("")

    def transport_to(self, basket: str) -> None:
        """Take what is held away, to a basket."""
        self.baskets += [(basket, garment.label) for garment in self.held]
        self.held = []

    def weight(self) -> float | None:
        """Each garment weighs as much."""
        return KILOGRAMS * len(self.held)


def colour(label: int) -> tuple[int, int, int]:
    """The colour of the garment of a label: never white, and another for each label below 9000.

    Examples
    --------
    >>> len({colour(label) for label in range(1, 9000)})
    8999
    """
    return (label * 97) % 200, (label // 200 * 31) % 251, 40 + label % 180


def _jaws(pose: Pose, shape: tuple[int, int]) -> BoolImage:
    y, x = np.arange(shape[0])[:, None], np.arange(shape[1])
    along = (x - pose.x) * math.cos(pose.theta) + (y - pose.y) * math.sin(pose.theta)
    across = (y - pose.y) * math.cos(pose.theta) - (x - pose.x) * math.sin(pose.theta)
    return np.asarray((np.abs(along) <= JAW[0] / 2) & (np.abs(across) <= JAW[1] / 2))


def _moved(mask: BoolImage, point: tuple[float, float]) -> BoolImage:
    rows, columns = np.nonzero(mask)
    if len(rows) == 0:
        return mask
    shifts = []
    for places, to, size in ((rows, point[1], mask.shape[0]), (columns, point[0], mask.shape[1])):
        wanted = round(to - float(places.mean()))
        shifts.append(int(np.clip(wanted, -places.min(), size - 1 - places.max())))
    moved = np.zeros_like(mask)
    moved[rows + shifts[0], columns + shifts[1]] = True
    return moved


def small_table() -> Tabletop:
    """Two garments that lie apart and one across the first of them, on 120 x 60 pixels.

    Examples
    --------
    >>> len(small_table().garments)
    3
    """
    labels = np.zeros((60, 120), dtype=np.int32)
    labels[10:50, 10:50], labels[10:50, 70:110] = 1, 2
    across = np.zeros(labels.shape, dtype=np.bool_)
    across[30:40, 40:60] = True
    return Tabletop.of(labels, over=[across])

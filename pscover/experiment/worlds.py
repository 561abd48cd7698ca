"""The worlds that an experiment can be made in."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from pscover.errors import MissingDependency
from pscover.execution.sight import BoolImage, Eyes
from pscover.execution.tabletop import ColourEyes, Tabletop, colour
from pscover.generate.garments import garments
from pscover.robot import Camera, Frame, Pose, Robot

Kind = Literal["cloth", "tabletop"]
TRUTH = "truth"
"""The segmenter that knows where the garments are: what a perfect one would be worth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """How many garments are where."""

    on_table: int
    in_basket: int
    off_table: int


class World(Protocol):
    """A table with garments, for experiments."""

    @property
    def robot(self) -> Robot:
        """The arm."""
        ...

    @property
    def camera(self) -> Camera:
        """Above the table."""
        ...

    @property
    def eyes(self) -> Eyes:
        """What looks at the camera's frames."""
        ...

    def count(self) -> Count:
        """Where the garments are in truth."""
        ...

    def seconds(self) -> float:
        """Of the robot's clock: how long its motions would have taken a real arm."""
        ...


def check_world(kind: Kind) -> None:
    """Raise `MissingDependency` unless the packages that a world needs are installed."""
    if kind == "cloth" and importlib.util.find_spec("numba") is None:
        raise MissingDependency.for_extra("the simulated world", ["numba"], "sim")


def opened(kind: Kind, seed: int, *, segmenter: str = "classical", cache: Path | None = None) -> World:
    """The world of a scene.

    Parameters
    ----------
    kind
        "cloth" is simulated physics (see `pscover.sim`); "tabletop" is none, and quick.
    seed
        Of the scene: an episode of the same seed begins with the same scene, whatever the policy.
    segmenter
        What finds garments in pictures of the cloth; "truth" for the true ones.
    cache
        Where scenes of cloth are kept.

    Examples
    --------
    >>> opened("tabletop", 0).count()
    Count(on_table=10, in_basket=0, off_table=0)
    """
    if kind == "tabletop":
        return FlatWorld.scene(seed)
    check_world(kind)
    from pscover.experiment.cloth_world import ClothWorld

    return ClothWorld.scene(seed, segmenter=segmenter, cache=cache)


@dataclass(frozen=True, slots=True)
class Sorting:
    """An arm of one basket as one of several: the garments are counted together, whichever basket was meant.

    Parameters
    ----------
    arm
        The arm.
    """

    arm: Robot

    def pick(self, pose: Pose) -> None:
        """Of the arm."""
        self.arm.pick(pose)

    def place(self, point: tuple[float, float]) -> None:
        """Of the arm."""
        self.arm.place(point)

    def transport(self) -> None:
        """Of the arm."""
        self.arm.transport()

    def transport_to(self, basket: str) -> None:
        """To the one basket."""
        self.arm.transport()

    def weight(self) -> float | None:
        """Of the arm."""
        return self.arm.weight()


MOTIONS = {"pick": 10.0, "place": 6.0, "transport": 8.0}
"""Seconds of the motions on the table top."""


@dataclass(slots=True, kw_only=True)
class FlatWorld:
    """Ten flat garments, piled without physics: for tests of the experiment itself.

    Parameters
    ----------
    table
        Robot and camera.
    clock
        Seconds so far.
    """

    table: Tabletop
    clock: float = 0.0
    total: int = field(default=0)

    @classmethod
    def scene(cls, seed: int) -> FlatWorld:
        """Six garments side by side, four across them."""
        scene = garments(6, seed=seed, size=(141, 235))
        random = np.random.default_rng([seed, 1])
        over: list[BoolImage] = []
        for _ in range(4):
            mask = np.zeros(scene.shape, dtype=np.bool_)
            top, left = int(random.integers(0, 100)), int(random.integers(0, 180))
            mask[top : top + int(random.integers(15, 40)), left : left + int(random.integers(20, 55))] = True
            over.append(mask)
        table = Tabletop.of(scene, over=over)
        return cls(table=table, total=len(table.garments))

    @property
    def robot(self) -> Robot:
        """The arm, with a clock."""
        return self

    @property
    def camera(self) -> Camera:
        """The table's."""
        return self

    @property
    def eyes(self) -> Eyes:
        """They know the colours; every other garment is white laundry, the rest dark."""
        kinds = (("dark", "white")[label % 2] for label in range(1, self.total + 1))
        return ColourEyes(kinds=tuple((*colour(label), kind) for label, kind in enumerate(kinds, start=1)))

    def capture(self) -> Frame:
        """See `Tabletop.capture`."""
        return self.table.capture()

    def pick(self, pose: Pose) -> None:
        """See `Tabletop.pick`."""
        self.clock += MOTIONS["pick"]
        self.table.pick(pose)

    def place(self, point: tuple[float, float]) -> None:
        """See `Tabletop.place`."""
        self.clock += MOTIONS["place"]
        self.table.place(point)

    def transport(self) -> None:
        """See `Tabletop.transport`."""
        self.clock += MOTIONS["transport"]
        self.table.transport()

    def weight(self) -> float | None:
        """See `Tabletop.weight`."""
        return self.table.weight()

    def count(self) -> Count:
        """Nothing falls off."""
        gone = len(self.table.baskets)
        return Count(on_table=self.total - gone, in_basket=gone, off_table=0)

    def seconds(self) -> float:
        """By `MOTIONS`."""
        return self.clock

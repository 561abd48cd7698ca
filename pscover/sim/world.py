"""A table of cloth, a camera above it and a robot beside it."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings, MissingDependency
from pscover.robot import Frame, Pose
from pscover.sim.arm import Arm
from pscover.sim.camera import ClothCamera
from pscover.sim.clock import Clock
from pscover.sim.cloth import Cloth, cloth, law
from pscover.sim.contact import near
from pscover.sim.film import Film
from pscover.sim.fingers import hand
from pscover.sim.picture import Painter
from pscover.sim.pour import drop, pour
from pscover.sim.robot import ClothRobot
from pscover.sim.settings import TABLE, WorldSettings
from pscover.sim.surface import Surface
from pscover.sim.truth import Truth
from pscover.sim.view import Oblique, Overhead, Projection
from pscover.sim.wardrobe import Garment, wardrobe

IN_BASKET = 0.3
"""Metres from the basket's middle, along x and y, within which cloth is in it."""


@dataclass(slots=True, eq=False)
class World:
    """Everything there is. Build it with `World.scene`, or with `World.of` from garments of one's own.

    Parameters
    ----------
    settings
        All constants.
    garments
        What there is to clear.
    cloth, arm
        The state of the physics.
    surface, painter, view
        What the camera sees of it.
    clock
        The robot's.
    seed
        Of the camera's noise.
    """

    settings: WorldSettings
    garments: tuple[Garment, ...]
    cloth: Cloth
    arm: Arm
    surface: Surface
    painter: Painter
    view: Projection
    clock: Clock
    seed: int
    parked: tuple[float, float] = TABLE
    _basket: list[int] = field(default_factory=list)
    _fallen: list[int] = field(default_factory=list)
    _films: list[Film] = field(default_factory=list)
    _camera: ClothCamera | None = None

    @classmethod
    def of(cls, garments: Sequence[Garment], settings: WorldSettings, *, seed: int = 0) -> World:
        """Garments that lie flat side by side in the table's corner, for experiments that arrange them themselves.

        Raises
        ------
        MissingDependency
            Without numba.
        """
        if importlib.util.find_spec("numba") is None:
            raise MissingDependency.for_extra("the simulated world", ["numba"], "sim")
        spacing, jaw = settings.material.spacing, settings.gripper
        state = cloth(garments, spacing)
        n = len(state.mass)
        surface = Surface.of(garments, settings.material)
        films: list[Film] = []

        def watch(seconds: float) -> None:
            for film in films:
                film.passed(seconds)

        arm = Arm(
            cloth=state,
            pairs=near(n),
            hand=hand(n, (jaw.finger / 2, jaw.width / 2, jaw.height), jaw.opening),
            law=law(settings.material),
            gripper=jaw,
            watch=watch,
        )
        view = Overhead.of(settings.sensor).projection()
        painter = Painter.of(garments, surface, settings)
        made = cls(settings, tuple(garments), state, arm, surface, painter, view, Clock(settings.pace), seed, _films=films)
        made._camera = ClothCamera(made, np.random.default_rng([seed, 1]))
        return made

    @classmethod
    def scene(cls, seed: int, settings: WorldSettings | None = None, *, cache: Path | None = None) -> World:
        """The ten garments poured over the table and mixed by random pick-and-place moves.

        Parameters
        ----------
        seed
            Of everything random.
        settings
            All constants.
        cache
            An existing folder where scenes are kept: a scene takes some 15 CPU-seconds to make. Scenes of other settings
            or of another version of the physics are told apart.

        Raises
        ------
        InvalidSettings
            If the seed is negative.
        MissingDependency
            Without numba.
        PscoverError
            If the folder cannot be written.
        """
        from pscover.sim import bank

        settings = settings or WorldSettings()
        if seed < 0:
            raise InvalidSettings(f"seed: expected at least 0, got {seed}")
        garments = wardrobe(settings.material.scale)
        rest = None if cache is None else bank.load(bank.path(cache, seed, settings))
        if rest is None:
            mixing = cls.of(garments, settings, seed=seed)
            mixing._mix(np.random.default_rng([seed, 0]))
            rest = bank.Rest.of(mixing.cloth)
            if cache is not None:
                bank.save(rest, bank.path(cache, seed, settings))
        # Always a fresh world, so that it goes on alike whether its scene was made or read.
        world = cls.of(garments, settings, seed=seed)
        rest.restore(world.cloth)
        return world

    @property
    def camera(self) -> ClothCamera:
        """Looks from above; implements `pscover.robot.Camera`."""
        assert self._camera is not None
        return self._camera

    @property
    def robot(self) -> ClothRobot:
        """Implements `pscover.robot.Robot`."""
        return ClothRobot(self)

    @property
    def seconds(self) -> float:
        """The robot's clock."""
        return self.clock.seconds

    @property
    def pixels_per_cm(self) -> float:
        """Scale of the image on the table."""
        return self.settings.sensor.columns / (100 * TABLE[0])

    @property
    def basket(self) -> tuple[float, float]:
        """Its middle in pixels of the image, beyond its edge."""
        point = np.array([[*self.settings.basket, 0.0]])
        x, y, _ = self.view.screen(point)[0].tolist()
        return x, y

    def truth(self) -> Truth:
        """Where each garment is now."""
        held = self.arm.held
        labels, _ = self.surface.labels(self.cloth, self.view)
        labels.setflags(write=False)
        on_table = (g for g in np.flatnonzero(self.cloth.present).tolist() if g not in held)
        return Truth(
            on_table=tuple(on_table),
            held=held,
            in_basket=tuple(sorted(self._basket)),
            off_table=tuple(sorted(self._fallen)),
            names=tuple(garment.name for garment in self.garments),
            labels=labels,
        )

    def layers(self) -> NDArray[np.int8]:
        """Garments above each pixel, hidden ones too: 0 for none, 1 + garment; shape (layers, H, W), the lowest first."""
        return self.surface.layers(self.cloth, self.view)

    @contextmanager
    def film(
        self, show: Callable[[Frame], object], *, fps: float = 10.0, view: Overhead | Oblique | None = None
    ) -> Iterator[None]:
        """While this lasts, show a frame of every 1/fps second of physics, with the fingers in the picture.

        Parameters
        ----------
        show
            Called with each frame: no depth, no noise.
        fps
            Frames a second.
        view
            From where; overhead as the camera by default.
        """
        chosen = view or Overhead.of(self.settings.sensor)
        film = Film(world=self, show=show, period=1.0 / fps, view=chosen.projection())
        self._films.append(film)
        try:
            yield
        finally:
            self._films.remove(film)

    def settle(self, least: float, most: float) -> None:
        """Let cloth come to rest; then take away what is in the basket or off the table."""
        self.arm.settle(least, most)
        beyond = self._beyond()
        for g in np.flatnonzero(beyond).tolist():
            own = slice(int(self.cloth.start[g]), int(self.cloth.start[g + 1]))
            offset = np.abs(self.cloth.position[own, :2] - self.settings.basket)
            into = float((offset < IN_BASKET).all(axis=1).mean()) > 0.5
            (self._basket if into else self._fallen).append(g)
            self.cloth.present[g] = 0
            self.arm.pairs.found[0] = -1

    def _beyond(self) -> NDArray[np.bool_]:
        """Garments of which more than half lies beyond the table's edges and none between the fingers."""
        x, y = self.cloth.position[:, 0], self.cloth.position[:, 1]
        out = (x < 0) | (x > TABLE[0]) | (y < 0) | (y > TABLE[1])
        part = np.add.reduceat(out.astype(float), self.cloth.start[:-1]) / np.diff(self.cloth.start)
        beyond: NDArray[np.bool_] = (part > 0.5) & (self.cloth.present == 1)
        beyond[list(self.arm.held)] = False
        return beyond

    def _mix(self, generator: np.random.Generator) -> None:
        """The reset of the paper's experiment; what falls off the table is thrown back."""
        pour(self.arm, self.settings.pour, generator)
        self._throw_back(generator)
        robot = self.robot
        for _ in range(self.settings.pour.moves):
            labels, _ = self.surface.labels(self.cloth, self.view)
            pixels = np.argwhere(labels > 0)
            y, x = pixels[generator.integers(len(pixels))].tolist()
            robot.pick(Pose(x=x, y=y, theta=generator.uniform(-np.pi / 2, np.pi / 2)))
            rows, columns = self.view.shape
            robot.place((generator.uniform(0, columns - 1), generator.uniform(0, rows - 1)))
            self._throw_back(generator)

    def _throw_back(self, generator: np.random.Generator) -> None:
        self.settle(0.0, 0.1)
        while self._fallen or self._basket:
            drop(self.arm, (self._fallen or self._basket).pop(), generator)
            self.settle(0.0, 0.1)

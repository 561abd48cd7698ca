"""Simulated cloth as a world of experiments: seen by perception, or as it truly is."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from pscover.execution.sight import BoolImage, Eyes, FloatImage, PhotoEyes
from pscover.experiment.worlds import TRUTH, Count
from pscover.inputs import Look
from pscover.perception.table_plane import TablePlane
from pscover.robot import Camera, Frame, Robot
from pscover.scene import Scene
from pscover.seen import Seen
from pscover.sim.world import World as Cloth


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueEyes:
    """Perception whose segmenter knows the garments; cloth and heights are perceived.

    Parameters
    ----------
    world
        Whose truth it tells.
    photo
        What perceives the rest.
    """

    world: Cloth
    photo: PhotoEyes

    @property
    def pixels_per_cm(self) -> float:
        """Scale of the frame."""
        return self.photo.pixels_per_cm

    @property
    def basket(self) -> tuple[float, float] | None:
        """Where garments are taken."""
        return self.photo.basket

    def cloth(self, frame: Frame) -> BoolImage:
        """As perceived."""
        return self.photo.cloth(frame)

    def segments(self, frame: Frame) -> Seen:
        """The true garments, where the camera sees them."""
        labels = self.world.truth().labels
        scene = Scene.of(labels, pixels_per_cm=self.pixels_per_cm, basket=self.basket, photo=frame.rgb)
        return Seen.whole(scene, "the true garments")

    def heights(self, frame: Frame) -> FloatImage:
        """As perceived."""
        return self.photo.heights(frame)

    def classes(self, frame: Frame, seen: Seen) -> tuple[str, ...]:
        """As perceived."""
        return self.photo.classes(frame, seen)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClothWorld:
    """A scene of `pscover.sim`.

    Parameters
    ----------
    cloth
        The physics.
    eyes
        What looks at its frames.
    """

    cloth: Cloth
    eyes: Eyes = field(repr=False)

    @classmethod
    def scene(cls, seed: int, *, segmenter: str, cache: Path | None) -> ClothWorld:
        """The scene of a seed."""
        return cls.of(Cloth.scene(seed, cache=cache), segmenter=segmenter)

    @classmethod
    def of(cls, cloth: Cloth, *, segmenter: str) -> ClothWorld:
        """Garments that lie somehow, and eyes that know the camera's height."""
        look = Look(
            segmenter="classical" if segmenter == TRUTH else segmenter,
            pixels_per_cm=cloth.pixels_per_cm,
            basket=cloth.basket,
        )
        table = TablePlane(offset=1 / cloth.settings.sensor.height, slope_x=0.0, slope_y=0.0)
        photo = PhotoEyes(look=look, table=table)
        return cls(cloth=cloth, eyes=TrueEyes(world=cloth, photo=photo) if segmenter == TRUTH else photo)

    @property
    def robot(self) -> Robot:
        """The simulated arm."""
        return self.cloth.robot

    @property
    def camera(self) -> Camera:
        """The simulated camera."""
        return self.cloth.camera

    def count(self) -> Count:
        """By the simulator's truth."""
        truth = self.cloth.truth()
        return Count(
            on_table=len(truth.on_table) + len(truth.held),
            in_basket=len(truth.in_basket),
            off_table=len(truth.off_table),
        )

    def seconds(self) -> float:
        """Of the simulated robot's clock."""
        return self.cloth.seconds

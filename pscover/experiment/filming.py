"""An episode on film: seen from above, with the grasps that are planned and what they brought."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from pscover.errors import InvalidSettings
from pscover.execution.events import Captured, Decided, Ended, Event, Moved
from pscover.experiment.cloth_world import ClothWorld
from pscover.experiment.worlds import World
from pscover.policy import Pick, Transport
from pscover.robot import Frame, Pose
from pscover.sim.film_strip import Mark, Strip

JAW_CM = 8.5
FRAMES = 4.0
"""Frames of a second of physics."""
SHOWN = 0.08
"""Seconds for which each is shown: about three times as fast."""
READ, END = 1.2, 2.5
"""Seconds for which a new plan, and the end, can be read."""


@contextmanager
def filmed(world: World, policy: str, path: Path) -> Iterator[Callable[[Event], None]]:
    """Film what happens in a world while this lasts; then write an animated GIF.

    Parameters
    ----------
    world
        Of simulated cloth.
    policy
        Its name is written below the picture.
    path
        Of the GIF. It is not written if the episode breaks off.

    Yields
    ------
    Callable
        Takes the events of the episode.

    Raises
    ------
    InvalidSettings
        If the world has no film.
    MissingDependency
        Without Pillow.
    PscoverError
        If the file cannot be written.
    """
    if not isinstance(world, ClothWorld):
        raise InvalidSettings("film: expected the world 'cloth', got one whose garments do not move")
    strip = Strip(jaw=JAW_CM * world.eyes.pixels_per_cm, seconds=SHOWN, aside="basket >")
    story = _Story(strip=strip, policy=policy, world=world)
    with world.cloth.film(strip.show, fps=FRAMES):
        yield story.note
    strip.save(path)


@dataclass(slots=True, kw_only=True, eq=False)
class _Story:
    """Keeps marks and words of a strip in step with events."""

    strip: Strip
    policy: str
    world: ClothWorld
    planned: dict[Pose, int] = field(default_factory=dict)
    coming: list[Pose] = field(default_factory=list)
    """Of the trip under way."""
    trips: int = 0

    def note(self, event: Event) -> None:
        match event:
            case Captured():
                self._caption()
                self.strip.show(self._still())
            case Decided():
                self._decided(event)
            case Moved(action=Pick(pose=pose)):
                self.planned.pop(pose, None)
                self._mark()
            case Moved(action=Transport()):
                self.trips += 1
                self._caption()
            case Ended():
                self.planned.clear()
                self._mark()
                self.strip.hold(END)
            case _:
                pass

    def _decided(self, event: Decided) -> None:
        """Marks of a new plan, or of the rest of the last one."""
        for skip in event.skipped:
            self.planned.pop(skip.pose, None)
        if event.plan is not None:
            poses = (Pose(x=grasp.x, y=grasp.y, theta=grasp.theta) for grasp in event.plan.grasps)
            self.planned = {pose: number for number, pose in enumerate(poses, start=1)}
        self.coming = [action.pose for action in event.actions if isinstance(action, Pick)]
        for pose in self.coming:
            self.planned.setdefault(pose, max(self.planned.values(), default=0) + 1)
        self._mark()
        if event.plan is not None:
            self.strip.hold(READ)

    def _mark(self) -> None:
        marks = (Mark(number=number, pose=pose, now=pose in self.coming) for pose, number in self.planned.items())
        self.strip.marks = tuple(marks)

    def _caption(self) -> None:
        removed = self.world.count().in_basket
        self.strip.words = f"{self.policy} - garments in the basket: {removed}, trips: {self.trips}"

    def _still(self) -> Frame:
        """What the camera saw, without its noise: noise would fill the file."""
        cloth = self.world.cloth
        return Frame(rgb=cloth.painter.picture(cloth.cloth, cloth.view).rgb())

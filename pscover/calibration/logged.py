"""Grasps and what they took away, from records of runs (see `pscover.execution.episode`): labels that nobody had to write.

A garment that was seen before a grasp is taken for removed if most of its pixels have changed in the picture after the
trip. That is no truth: a garment that was dragged aside counts as removed, and one that hid another of its colour may not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidResult
from pscover.execution.episode import LOG, events
from pscover.execution.events import Captured, Decided, Judged, MotionFailed, Moved
from pscover.perception.depth import height_map
from pscover.policy import Pick
from pscover.robot import Frame, Pose
from pscover.scene import Scene
from pscover.seen import Seen

FloatArray = NDArray[np.float64]
CHANGED, GONE = 400.0, 0.5
"""Mean squared difference from which a pixel has changed, and the share of a garment's pixels from which it is gone."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Logged:
    """One grasp that was made.

    Parameters
    ----------
    episode
        The folder of its record.
    scene
        What was seen before it.
    pose
        x and y in pixels of the scene, theta, shape (3,).
    removed
        Whether each garment of the scene was gone afterwards, shape (garments,).
    heights
        Metres above the table, of the scene's shape, as policies see them; None where no depth shows a table.
    """

    episode: str
    scene: Scene
    pose: FloatArray
    removed: NDArray[np.bool_]
    heights: NDArray[np.floating] | None = None


def folders(root: str | PathLike[str]) -> list[Path]:
    """All folders with a record, at or below a folder, sorted.

    Raises
    ------
    InvalidResult
        If there is none.
    """
    found = sorted(path.parent for path in Path(root).rglob(LOG))
    if not found:
        raise InvalidResult(f"{root}: expected records of runs ({LOG}), got none; `pscover simulate --record` makes some")
    return found


def logged(places: Iterable[Path]) -> Iterator[Logged]:
    """The grasps of several records.

    Only trips of a single pick count, right after a picture in which garments were told apart: what happened to them between
    that picture and the grasp would be guessed otherwise.

    Raises
    ------
    InvalidResult
        If a record is damaged.
    """
    for folder in places:
        yield from _of_record(folder)


def _of_record(folder: Path) -> Iterator[Logged]:
    before: Frame | None = None
    after: Frame | None = None
    seen: Seen | None = None
    pose: Pose | None = None
    for event in events(folder):
        match event:
            case Captured():
                after = event.frame
            case Decided():
                before = after
                picks = [action for action in event.actions if isinstance(action, Pick)]
                seen = event.seen if len(picks) == 1 else None
                pose = None
            case Moved(action=Pick(pose=at)):
                pose = at
            case MotionFailed():
                pose = None
            case Judged() if seen is not None and pose is not None and before is not None and after is not None:
                yield _grasp(str(folder), seen, pose, before, after)
                seen = None
            case _:
                pass


def _grasp(episode: str, seen: Seen, pose: Pose, before: Frame, after: Frame) -> Logged:
    if not before.shape == after.shape == seen.grid.photo_shape:
        shapes = f"{before.shape}, {after.shape} and {seen.grid.photo_shape}"
        raise InvalidResult(f"{episode}: expected pictures and labels of one shape, got {shapes}")
    difference = before.rgb.astype(np.float32) - after.rgb
    changed = seen.grid.nearest((difference**2).mean(axis=2) > CHANGED)
    scene = seen.scene
    gone = np.bincount(scene.segments[changed] + 1, minlength=scene.garments + 1)[1:]
    x, y = seen.grid.from_photo(pose.x, pose.y)
    return Logged(
        episode=episode,
        scene=scene,
        pose=np.array([x, y, pose.theta]),
        removed=gone >= GONE * scene.areas(),
        heights=_heights(before, seen),
    )


def _heights(frame: Frame, seen: Seen) -> NDArray[np.floating] | None:
    if frame.depth is None:
        return None
    try:
        return seen.grid.nearest(height_map(frame.depth, metres_per_unit=1.0).metres)
    except InvalidImage:
        return None


def split(grasps: Sequence[Logged], share: float, seed: int = 0) -> tuple[list[Logged], list[Logged]]:
    """Grasps to fit to, and grasps of other episodes to test with.

    Parameters
    ----------
    grasps
        All.
    share
        Of the episodes that are held out.
    seed
        Of the choice.

    Raises
    ------
    InvalidResult
        If there are not at least two episodes.
    """
    episodes = sorted({grasp.episode for grasp in grasps})
    if len(episodes) < 2:
        raise InvalidResult(
            f"records: expected grasps of at least 2 episodes, one of them to test with, got {len(episodes)}"
        )
    count = min(len(episodes) - 1, max(1, round(share * len(episodes))))
    held = set(np.random.default_rng(seed).permutation(episodes)[:count].tolist())
    fitting = [grasp for grasp in grasps if grasp.episode not in held]
    return fitting, [grasp for grasp in grasps if grasp.episode in held]

"""What every pick of simulated episodes had under the gripper, and what it took: the world against the paper's predictor.

python bench/picks_table.py --policy segment --segmenter truth --scenes 7 -o picks.csv
python bench/picks_table.py --plans 7          # how many grasps plans need, by the predictor's b

The predictor says p = a / (a + b) of a garment of which a pixels are seen under the ellipse, b = 100. A row of the CSV is
one garment under one pick; one that was taken without having been seen there has 0 pixels.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from pscover.execution.declutter import declutter
from pscover.experiment.cloth_world import ClothWorld
from pscover.experiment.trial import Trial, policy_of
from pscover.grasping.ellipse import Ellipse
from pscover.planning import plan
from pscover.robot import Pose
from pscover.scene import Scene
from pscover.sim import World

AREAS = (0, 1, 25, 50, 100, 200, 400)
HALVES = (100.0, 30.0, 10.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Under:
    """A garment under a pick.

    Parameters
    ----------
    policy, segmenter, scene, pick, garment
        Which.
    pixels
        Of the garment that are seen in the ellipse.
    held, removed
        Whether it was between the fingers after the pick, and in the basket after the trip.
    """

    policy: str
    segmenter: str
    scene: int
    pick: int
    garment: int
    pixels: int
    held: bool
    removed: bool


@dataclass(slots=True, kw_only=True)
class Watched:
    """The arm of a world, and what it did."""

    world: World
    policy: str
    segmenter: str
    rows: list[Under] = field(default_factory=list)
    picks: int = 0
    _seen: dict[int, int] = field(default_factory=dict)
    _held: tuple[int, ...] = ()

    def pick(self, pose: Pose) -> None:
        """Note what lies under the gripper, then pick."""
        scene = Scene.of(self.world.truth().labels)
        at = np.array([[pose.x, pose.y, pose.theta]])
        pixels = Ellipse().areas(scene, at).toarray()[:, 0]
        self._seen = {int(scene.values[j]) - 1: int(pixels[j]) for j in np.flatnonzero(pixels)}
        self.world.robot.pick(pose)
        self._held = self.world.truth().held
        self.picks += 1

    def place(self, point: tuple[float, float]) -> None:
        """Picks that end in a place are not counted."""
        self.world.robot.place(point)

    def transport(self) -> None:
        """Carry, and note what came of the pick."""
        before = set(self.world.truth().in_basket)
        self.world.robot.transport()
        removed = set(self.world.truth().in_basket) - before
        for garment in sorted(self._seen.keys() | set(self._held) | removed):
            self.rows.append(
                Under(
                    policy=self.policy,
                    segmenter=self.segmenter,
                    scene=self.world.seed,
                    pick=self.picks,
                    garment=garment,
                    pixels=self._seen.get(garment, 0),
                    held=garment in self._held,
                    removed=garment in removed,
                )
            )

    def weight(self) -> float | None:
        """Nobody asks."""
        return None


def episode(policy: str, segmenter: str, seed: int, cache: Path | None) -> list[Under]:
    """All picks of an episode, as `pscover simulate` runs it."""
    world = World.scene(seed, cache=cache)
    arm = Watched(world=world, policy=policy, segmenter=segmenter)
    made = policy_of(Trial(policy=policy))
    eyes = ClothWorld.of(world, segmenter=segmenter).eyes
    patience = Trial(policy=policy).patience
    for _ in declutter(arm, world.camera, made, eyes=eyes, patience=patience, seed=seed):
        pass
    return arm.rows


def by_area(rows: list[Under]) -> Iterator[str]:
    """Lines: how many garments with so many pixels under the ellipse were removed, and what the predictor says."""
    yield f"{'pixels':>10} {'garments':>9} {'removed':>8} {'share':>6} {'a / (a + 100)':>14}"
    for low, high in pairwise(AREAS):
        group = [row for row in rows if low <= row.pixels < high]
        if group:
            said = np.mean([row.pixels / (row.pixels + 100) for row in group])
            removed = sum(row.removed for row in group)
            yield f"{low:>5}-{high - 1:<4} {len(group):>9} {removed:>8} {removed / len(group):>6.2f} {said:>14.2f}"


def plans(scenes: int, cache: Path | None) -> Iterator[str]:
    """Lines: grasps of a first plan with the true segments, by b."""
    yield f"{'scene':>6} {'garments':>9} " + " ".join(f"{f'b = {half:g}':>8}" for half in HALVES)
    for seed in range(scenes):
        world = World.scene(seed, cache=cache)
        scene = Scene.of(world.truth().labels, pixels_per_cm=world.pixels_per_cm, basket=world.basket)
        counts = [len(plan(scene, predictor=Ellipse(half=half), backend="auto", time=30).grasps) for half in HALVES]
        yield f"{seed:>6} {scene.garments:>9} " + " ".join(f"{count:>8}" for count in counts)


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--policy", default="segment")
    parser.add_argument("--segmenter", default="truth")
    parser.add_argument("--scenes", type=int, default=7)
    parser.add_argument("--plans", type=int, default=0, help="only count the grasps of plans, on so many scenes")
    parser.add_argument("--cache", type=Path, help="an existing folder where scenes are kept")
    parser.add_argument("-o", "--output", type=Path)
    asked = parser.parse_args()
    if asked.plans:
        print(*plans(asked.plans, asked.cache), sep="\n")
        return
    rows = [row for seed in range(asked.scenes) for row in episode(asked.policy, asked.segmenter, seed, asked.cache)]
    print(*by_area(rows), sep="\n")
    if asked.output:
        with asked.output.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(asdict(rows[0])), lineterminator="\n")
            writer.writeheader()
            writer.writerows(asdict(row) for row in rows)


if __name__ == "__main__":
    main()

"""The simulated world: CPU seconds of a scene, of an episode of random grasps, of an image, and of a policy's episode.

pytest bench/bench_sim.py
PSCOVER_MODELS=models pytest bench/bench_sim.py -k mobile   # with the segmenter `mobile-sam`, where its weights are
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

pytest.importorskip("numba")
from pscover.errors import InvalidSettings, MissingDependency
from pscover.execution.declutter import PATIENCE, declutter
from pscover.execution.events import Judged
from pscover.experiment.cloth_world import ClothWorld
from pscover.experiment.trial import Trial, policy_of
from pscover.policy import Policy
from pscover.robot import Pose
from pscover.sim import Oblique, World


@pytest.fixture(scope="module")
def bank(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scenes made in this run; the kernels are compiled, too."""
    folder = tmp_path_factory.mktemp("bank")
    World.scene(0, cache=folder).camera.capture()
    return folder


def bench_scene(benchmark: Any, row: Any, bank: Path) -> None:
    """Pour and ten random moves, from nothing."""
    begin = time.process_time()
    benchmark.pedantic(World.scene, args=(1,), rounds=1)
    spent = time.process_time() - begin
    row("simulated world", what="scene", cpu_seconds=spent)


def bench_episode(benchmark: Any, row: Any, bank: Path) -> None:
    """Uniform garment pixels and angles until nothing is seen, with an image before each grasp."""

    def episode() -> tuple[int, int, float, float]:
        world, generator = World.scene(0, cache=bank), np.random.default_rng(0)
        seeing = moving = 0.0
        transports = 0
        while (truth := world.truth()).visible:
            rows, columns = np.nonzero(truth.labels)
            pixel = generator.integers(len(rows))
            begin = time.process_time()
            world.camera.capture()
            seen = time.process_time()
            world.robot.pick(Pose(x=int(columns[pixel]), y=int(rows[pixel]), theta=generator.uniform(-np.pi / 2, np.pi / 2)))
            world.robot.transport()
            seeing, moving = seeing + seen - begin, moving + time.process_time() - seen
            transports += 1
        return len(world.truth().in_basket), transports, seeing, moving

    removed, transports, seeing, moving = benchmark.pedantic(episode, rounds=1)
    assert removed <= 10
    row("simulated world", what="episode: robot", cpu_seconds=moving, transports=transports)
    row("simulated world", what="episode: camera", cpu_seconds=seeing, transports=transports)


@pytest.mark.parametrize("view", ["camera", "oblique film"])
def bench_image(benchmark: Any, row: Any, bank: Path, view: str) -> None:
    """One image of a full table."""
    world = World.scene(0, cache=bank)
    oblique = Oblique().projection()
    take = world.camera.capture if view == "camera" else lambda: world.painter.picture(world.cloth, oblique)
    take()
    begin = time.process_time()
    benchmark.pedantic(take, rounds=5)
    row("simulated world", what=f"image: {view}", cpu_seconds=(time.process_time() - begin) / 5)


class Clocked:
    """Something whose methods are timed: CPU seconds by what they are for."""

    def __init__(self, own: Any, spent: dict[str, float], **purposes: str) -> None:
        self._own, self._spent, self._purposes = own, spent, purposes

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._own, name)
        return self._timed(found, self._purposes[name]) if name in self._purposes else found

    def _timed(self, call: Callable[..., Any], purpose: str) -> Callable[..., Any]:
        def timed(*arguments: Any) -> Any:
            begin = time.process_time()
            try:
                return call(*arguments)
            finally:
                self._spent[purpose] += time.process_time() - begin

        return timed


@pytest.mark.parametrize(("name", "segmenter"), [("random", "classical"), ("segment", "truth"), ("segment", "mobile-sam")])
def bench_policy(benchmark: Any, row: Any, bank: Path, name: str, segmenter: str) -> None:
    """An episode of `pscover simulate`, by what its CPU seconds go to."""
    world = ClothWorld.scene(0, segmenter=segmenter, cache=bank)
    spent: dict[str, float] = defaultdict(float)
    robot = Clocked(world.robot, spent, pick="physics", place="physics", transport="physics")
    camera = Clocked(world.camera, spent, capture="camera")
    eyes = Clocked(world.eyes, spent, cloth="cloth map", segments="segmentation", heights="heights")
    own = cast(Policy, Clocked(policy_of(Trial(policy=name)), spent, next="decisions"))
    trips = 0

    def episode() -> None:
        nonlocal trips
        for event in declutter(robot, camera, own, eyes=eyes, patience=replace(PATIENCE, empty_kilograms=0.0)):
            trips += isinstance(event, Judged)

    begin = time.process_time()
    try:
        benchmark.pedantic(episode, rounds=1)
    except (MissingDependency, InvalidSettings) as missing:  # no package, or no weights
        pytest.skip(str(missing))
    total = time.process_time() - begin
    parts = {what: spent[what] for what in ("physics", "camera", "cloth map", "segmentation")}
    parts["planning"] = spent["decisions"] - spent["segmentation"] if name == "segment" else 0.0
    row("simulated world: an episode", policy=name, segmenter=segmenter, trips=trips, total=total, **parts)

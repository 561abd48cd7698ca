"""The simulated world: CPU seconds of a scene, of an episode of random grasps, of an image, and where a step's time goes.

pytest bench/bench_sim.py
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("numba")
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

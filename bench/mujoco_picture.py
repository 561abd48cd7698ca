"""A grasp in the world of cloth and in MuJoCo, to look at: the jaw closed, and lifted.

python bench/mujoco_picture.py 1 border --cache scenes/ -o grasp.png
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from mujoco_grasps import KINDS, Grasp, place
from numpy.typing import NDArray
from PIL import Image

from pscover.sim import World
from pscover.sim.cloth import FloatArray
from pscover.sim.fingers import COSINE, GAP, SINE, X, Y, Z
from pscover.sim.held import Jaw
from pscover.sim.mujoco_jaw import replay
from pscover.sim.view import Oblique


def picture(grasp: Grasp, cache: Path | None, path: Path) -> None:
    """Our world above, MuJoCo below."""
    rows = [np.concatenate(draw(grasp, cache), axis=1) for draw in (_ours, _mujoco)]
    # A palette: a third of the bytes.
    Image.fromarray(np.concatenate(rows)).quantize(128).save(path, optimize=True)


def _drawn(world: World, x: float, y: float) -> NDArray[np.uint8]:
    view = Oblique(rows=300, columns=400, target=(x, y, 0.16), distance=1.35, azimuth=25)
    return world.painter.picture(world.cloth, view.projection(), world.arm.hand).rgb()


def _ours(grasp: Grasp, cache: Path | None) -> list[NDArray[np.uint8]]:
    world = World.scene(grasp.scene, cache=cache)
    x, y, theta = place(world, grasp.kind)
    world.arm.close_at(x, y, theta)
    closed = _drawn(world, x, y)
    world.arm.lift(world.settings.gripper.lift)
    return [closed, _drawn(world, x, y)]


def _mujoco(grasp: Grasp, cache: Path | None) -> list[NDArray[np.uint8]]:
    world = World.scene(grasp.scene, cache=cache)
    x, y, theta = place(world, grasp.kind)
    seen: list[tuple[FloatArray, Jaw]] = []
    made = replay(world, x, y, theta, show=lambda position, jaw: seen.append((position, jaw)))
    down = world.settings.gripper.tip + 0.002
    closed = [moment for moment in seen if moment[1].z < down][-1]
    drawn = []
    for position, jaw in (closed, (made.after, made.jaw)):
        world.cloth.position[:] = position
        state = world.arm.hand.state
        state[[X, Y, Z, GAP, COSINE, SINE]] = jaw.x, jaw.y, jaw.z, jaw.gap, np.cos(theta), np.sin(theta)
        drawn.append(_drawn(world, x, y))
    return drawn


def main() -> None:
    """Draw what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=int)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--cache", type=Path, help="an existing folder where scenes are kept")
    parser.add_argument("-o", "--output", type=Path, default=Path("grasp.png"))
    asked = parser.parse_args()
    picture(Grasp(scene=asked.scene, kind=asked.kind), asked.cache, asked.output)


if __name__ == "__main__":
    main()

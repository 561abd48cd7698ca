"""The simulated world through its door: protocols, counts, pictures, scenes on disk, and what it may know."""

from __future__ import annotations

import ast
import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("numba")
import pscover
from pscover.errors import InvalidSettings, PscoverError
from pscover.robot import Camera, Frame, Pose, Robot, RobotFailed
from pscover.sim import Material, Oblique, Overhead, Pour, Sensor, World, WorldSettings, bank
from pscover.sim.wardrobe import Garment, wardrobe

PACKAGE = Path(pscover.__file__).parent
# Coarse cloth and few moves: what is tested here is no matter of fine folds.
COARSE = WorldSettings(material=Material(spacing=0.03, scale=0.6), pour=Pour(moves=1))


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("folder", ["policies", "grasping", "perception"])
def test_what_plans_knows_no_world(folder: str) -> None:
    paths = [*(PACKAGE / folder).rglob("*.py"), PACKAGE / "planning.py", PACKAGE / "robot.py"]
    assert len(paths) > 2
    for path in paths:
        assert not [name for name in imported(path) if name.startswith("pscover.sim")], path


def test_the_world_knows_no_predictor() -> None:
    for path in (PACKAGE / "sim").glob("*.py"):
        wrong = [n for n in imported(path) if n.startswith(("pscover.grasping", "pscover.planning", "pscover.policies"))]
        assert not wrong, path


def flat(*names: str) -> tuple[World, tuple[Garment, ...]]:
    """Some garments lying flat and apart on the table."""
    chosen = tuple(garment for garment in wardrobe(0.6) if garment.name in names)
    world = World.of(chosen, COARSE)
    cloth = world.cloth
    for g in range(len(chosen)):
        own = slice(int(cloth.start[g]), int(cloth.start[g + 1]))
        cloth.position[own, :2] += 0.25 + 0.45 * g, 0.3
        cloth.position[own, 2] = world.arm.law.thickness / 2
    cloth.before[:] = cloth.position
    cloth.anchor[:] = cloth.position
    return world, chosen


def pose_on(world: World, g: int) -> Pose:
    rows, columns = np.nonzero(world.truth().labels == g + 1)
    at = np.hypot(rows - rows.mean(), columns - columns.mean()).argmin()
    return Pose(x=int(columns[at]), y=int(rows[at]), theta=0.5)


def test_the_protocols_are_kept() -> None:
    world, _ = flat("towel")
    assert isinstance(world.camera, Camera)
    assert isinstance(world.robot, Robot)
    frame = world.camera.capture()
    assert frame.shape == (282, 470)
    assert frame.depth is not None
    assert frame.depth.dtype == np.float32
    assert 0 < np.isnan(frame.depth).mean() < 0.05
    assert np.nanmedian(frame.depth) == pytest.approx(1.3, abs=0.01)
    assert world.pixels_per_cm == pytest.approx(4.7)
    assert world.basket[0] > 470


def test_garments_go_where_the_robot_takes_them() -> None:
    world, _ = flat("towel", "hat")
    begin = world.truth()
    assert (begin.on_table, begin.visible, begin.names) == ((0, 1), (0, 1), ("hat", "towel"))
    world.robot.pick(pose_on(world, 0))
    assert world.truth().held == (0,)
    assert world.robot.weight() == pytest.approx(float(world.cloth.mass[world.cloth.garment == 0].sum()), rel=0.25)
    world.robot.place((235.0, 60.0))
    truth = world.truth()
    assert truth.held == ()
    assert abs(np.argwhere(truth.labels == 1).mean(axis=0)[1] - 235) < 30
    world.robot.pick(pose_on(world, 0))
    clock = world.seconds
    world.robot.transport()
    assert world.seconds > clock
    truth = world.truth()
    assert (truth.on_table, truth.held, truth.in_basket, truth.off_table) == ((1,), (), (0,), ())
    assert truth.visible == (1,)
    assert not (world.layers() == 1).any()
    world.robot.transport()
    assert world.truth().in_basket == (0,)
    assert world.robot.weight() == 0.0


def test_a_garment_put_down_over_the_edge_falls_off_the_table() -> None:
    world, _ = flat("hat")
    world.robot.pick(pose_on(world, 0))
    world.robot.place((235.0, 281.0))
    world.robot.pick(Pose(x=100, y=100))
    truth = world.truth()
    assert len(truth.on_table) + len(truth.off_table) == 1
    own = world.cloth.position
    own[:, 1] += 1.0
    world.cloth.asleep[:] = 0
    world.robot.transport()
    truth = world.truth()
    assert (truth.on_table, truth.off_table, truth.in_basket) == ((), (0,), ())


def test_a_new_pick_lets_go_of_what_was_held() -> None:
    world, _ = flat("towel", "hat")
    world.robot.pick(pose_on(world, 0))
    world.robot.pick(pose_on(world, 1))
    assert world.truth().held == (1,)
    assert world.truth().on_table == (0,)


def test_points_off_the_image_are_refused() -> None:
    world, _ = flat("hat")
    with pytest.raises(RobotFailed, match="470 x 282"):
        world.robot.pick(Pose(x=500, y=10))
    with pytest.raises(RobotFailed, match="y=-3"):
        world.robot.place((5.0, -3.0))


def test_labels_and_layers_show_the_stack() -> None:
    world, _ = flat("towel", "hat")
    cloth = world.cloth
    hat = cloth.garment == 0
    cloth.position[hat, :2] += cloth.position[~hat, :2].mean(axis=0) - cloth.position[hat, :2].mean(axis=0)
    cloth.position[hat, 2] += 0.05
    labels, layers = world.truth().labels, world.layers()
    assert layers.shape == (2, *labels.shape)
    both = layers[1] > 0
    assert both.sum() > 500
    assert (layers[0][both] == 2).all()
    assert (layers[1][both] == 1).all()
    top = np.where(layers[1] > 0, layers[1], layers[0])
    assert (top == labels).mean() > 0.998


def test_depth_shows_the_height_and_colour_the_garment() -> None:
    world, garments = flat("towel")
    world.cloth.position[:, 2] += 0.1
    frame, labels = world.camera.capture(), world.truth().labels
    assert frame.depth is not None
    assert np.nanmedian(frame.depth[labels == 1]) == pytest.approx(1.2, abs=0.02)
    blue = frame.rgb[labels == 1].astype(float).mean(axis=0)
    assert blue[2] > blue[0] + 40
    again = world.camera.capture()
    assert (frame.rgb != again.rgb).any()
    assert np.abs(frame.rgb.astype(int) - again.rgb).mean() < 8
    assert garments[0].name == "towel"


@pytest.mark.parametrize("view", [Overhead(), Oblique(rows=120, columns=200)])
def test_a_film_shows_the_arm_and_changes_nothing(view: Overhead | Oblique) -> None:
    filmed, alone = flat("hat")[0], flat("hat")[0]
    frames: list[Frame] = []
    with filmed.film(frames.append, fps=5, view=view):
        filmed.robot.pick(pose_on(filmed, 0))
    alone.robot.pick(pose_on(alone, 0))
    assert len(frames) >= 5
    assert frames[0].shape == (view.rows, view.columns)
    assert any((a.rgb != b.rgb).any() for a, b in itertools.pairwise(frames))
    np.testing.assert_array_equal(filmed.cloth.position, alone.cloth.position)
    before = len(frames)
    filmed.robot.transport()
    assert len(frames) == before


def test_scenes_are_kept_on_disk_by_seed_and_settings(tmp_path: Path) -> None:
    made = World.scene(5, COARSE, cache=tmp_path)
    assert made.truth().on_table == tuple(range(10))
    assert made.seconds == 0.0
    (stored,) = tmp_path.iterdir()
    content = stored.read_bytes()
    again = World.scene(5, COARSE, cache=tmp_path)
    assert stored.read_bytes() == content
    np.testing.assert_array_equal(made.cloth.position, again.cloth.position)
    np.testing.assert_array_equal(made.camera.capture().rgb, again.camera.capture().rgb)
    for world in (made, again):
        world.robot.pick(pose_on(world, 0))
        world.robot.transport()
    np.testing.assert_array_equal(made.cloth.position, again.cloth.position)
    other = replace(COARSE, material=replace(COARSE.material, cloth_friction=0.2))
    assert bank.path(tmp_path, 5, other) != stored
    assert bank.path(tmp_path, 6, COARSE) != stored
    assert bank.path(tmp_path, 5, replace(COARSE, sensor=Sensor(colour_noise=9.0))) == stored
    stored.write_bytes(content[:100])
    with pytest.raises(PscoverError, match="delete the file"):
        World.scene(5, COARSE, cache=tmp_path)


def test_wrong_settings_are_refused() -> None:
    with pytest.raises(InvalidSettings, match=r"Material\.rate"):
        Material(rate=0.0)
    with pytest.raises(InvalidSettings, match="slips through cloth"):
        Material(thickness=0.4)
    with pytest.raises(InvalidSettings, match="seed"):
        World.scene(-1)

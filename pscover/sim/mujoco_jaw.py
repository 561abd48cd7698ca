"""The same grasp in MuJoCo: garments of a world as flexible shells, pinched by friction between two actuated fingers.

A second opinion on `pscover.sim`, whose jaw holds cloth by decree (`pscover.sim.grip`). Nothing that plans or simulates
episodes imports this; it needs the extra `mujoco`.

What is the same: particles and triangles, their masses and places, the table, the fingers, their path and speed, the force
with which they press, and the coefficients of friction. What is not: triangles touch each other, not spheres, so that cloth
is as thick between two particles as at one; stretching and bending are those of an elastic shell that yields; nothing
sleeps; and the fingers hold by friction alone.

Layers of cloth stand 2 `Shell.radius` apart, on average about as far as the spheres of `pscover.sim`, which settle into each
other's gaps. From table and fingers cloth keeps the same distance as there: these are puffed up by the difference.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pscover.errors import MissingDependency
from pscover.sim.arm import ABOVE, CLOSING, SPEED
from pscover.sim.cloth import Cloth, FloatArray, meshes
from pscover.sim.held import Jaw
from pscover.sim.settings import TABLE, Gripper
from pscover.sim.step import FLOOR
from pscover.sim.world import World

TOUCH = 1.3
"""Of the particles' thickness: garments with particles nearer than this touch."""
REACH = 0.08
"""Metres from the jaw's middle, level with the table, within which a garment may be moved by the fingers."""
HOLD = 20_000.0, 400.0
"""Newtons a metre, and a metre a second, with which the arm is kept on its path."""
PRESS = 4_000.0, 40.0
"""The same for the fingers, up to `Gripper.force`."""
POISSON = 0.2
"""Poisson's ratio of cloth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shell:
    """Cloth as MuJoCo takes it.

    Parameters
    ----------
    radius
        Metres: half the thickness at which triangles touch each other.
    stretch
        Newtons a metre: how a strip a metre wide resists stretching.
    bending
        Newton metres: rigidity of the plate. That of `Material.bending` at bends of 0.7 rad at an edge.
    yields
        Bend at an edge, in 1 / metre, beyond which it stays. That of `Material.fold`.
    damping
        Seconds, Rayleigh's.
    step
        Seconds.
    iterations
        Of the solver, conjugate gradients, a step.
    settle
        Seconds in which cloth comes to rest under these laws before the fingers go down.
    """

    radius: float = 0.005
    stretch: float = 500.0
    bending: float = 1e-5
    yields: float = 55.0
    damping: float = 0.01
    step: float = 0.004
    iterations: int = 100
    settle: float = 0.2

    @property
    def thickness(self) -> float:
        """Of a plate with these rigidities."""
        return math.sqrt(12 * (1 - POISSON**2) * self.bending / self.stretch)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replayed:
    """A grasp that was made in MuJoCo.

    Parameters
    ----------
    garments
        Which were there, ascending.
    rest, after
        Positions of all particles when they had come to rest and after the lift, shape (particles, 3); of garments that were
        not there, those of before.
    jaw
        After the lift.
    steady
        Whether MuJoCo saw nothing that it warns about: no velocity without bounds, no lack of memory.
    """

    garments: tuple[int, ...]
    rest: FloatArray
    after: FloatArray
    jaw: Jaw
    steady: bool


def neighbours(cloth: Cloth, x: float, y: float, thickness: float) -> tuple[int, ...]:
    """Garments with a particle within `REACH` of a point, and those that touch one of these; ascending."""
    present = np.flatnonzero(cloth.present[cloth.garment] == 1)
    place, owner = cloth.position[present], cloth.garment[present]
    close = set(owner[np.hypot(place[:, 0] - x, place[:, 1] - y) < REACH].tolist())
    pairs = owner[cKDTree(place).query_pairs(TOUCH * thickness, output_type="ndarray")]
    return tuple(sorted(close | {int(b) for a, b in (*pairs, *pairs[:, ::-1]) if int(a) in close}))


def replay(
    world: World,
    x: float,
    y: float,
    theta: float,
    shell: Shell | None = None,
    *,
    show: Callable[[FloatArray, Jaw], object] = lambda position, jaw: None,
) -> Replayed:
    """Go down at a point of a world, close, and lift, all in MuJoCo; the world stays as it is.

    Parameters
    ----------
    world
        Whose cloth it is. Only `neighbours` of the point take part.
    x, y, theta
        Where the jaw closes, metres and radians.
    shell
        How cloth is made.
    show
        Called about 25 times a second of physics.

    Raises
    ------
    MissingDependency
        Without mujoco.
    """
    shell = shell or Shell()
    stage = _Stage.of(world, x, y, theta, shell)
    settling, rest = round(shell.settle / shell.step), world.cloth.position
    for count, (z, closed) in enumerate(_path(world.settings.gripper, shell)):
        stage.step(z, closed)
        if count + 1 == settling:
            rest = stage.position()
        if count % round(0.04 / shell.step) == 0:
            show(stage.position(), stage.jaw())
    return Replayed(garments=stage.garments, rest=rest, after=stage.position(), jaw=stage.jaw(), steady=stage.steady())


def rested(world: World, x: float, y: float, shell: Shell | None = None) -> FloatArray:
    """Positions of all particles once those near a point have come to rest in MuJoCo, as they are when `replay` begins.

    Raises
    ------
    MissingDependency
        Without mujoco.
    """
    shell = shell or Shell()
    stage = _Stage.of(world, x, y, 0.0, shell)
    for _ in range(round(shell.settle / shell.step)):
        stage.step(0.0, 0.0)
    return stage.position()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Stage:
    """A model of MuJoCo and its state, and which particles of a world are in it."""

    world: World
    model: Any
    data: Any
    garments: tuple[int, ...]
    own: NDArray[np.int64]
    at: tuple[float, float, float]

    @classmethod
    def of(cls, world: World, x: float, y: float, theta: float, shell: Shell) -> _Stage:
        """The neighbours of a point, laid as they lie."""
        if importlib.util.find_spec("mujoco") is None:
            raise MissingDependency.for_extra("a grasp in MuJoCo", ["mujoco"], "mujoco")
        import mujoco

        cloth = world.cloth
        garments = neighbours(cloth, x, y, world.arm.law.thickness)
        model = mujoco.MjModel.from_xml_string(scene(world, garments, x, y, theta, shell))
        data = mujoco.MjData(model)
        own = np.flatnonzero(np.isin(cloth.garment, garments))
        _lay(model, data, cloth.position[own])
        return cls(world=world, model=model, data=data, garments=garments, own=own, at=(x, y, theta))

    def step(self, z: float, closed: float) -> None:
        """One step with the tips at a height against `ABOVE`, each finger closed so far."""
        import mujoco

        self.data.ctrl[:] = z, closed, closed
        mujoco.mj_step(self.model, self.data)

    def position(self) -> FloatArray:
        """Of all particles of the world; of those that are not in the model, as it was."""
        position = self.world.cloth.position.copy()
        position[self.own] = self.data.flexvert_xpos
        return position

    def jaw(self) -> Jaw:
        """Where the jaw is."""
        x, y, theta = self.at
        z, left, right = self.data.qpos[:3].tolist()
        return Jaw(x=x, y=y, z=ABOVE + z, theta=theta, gap=self.world.settings.gripper.opening - left - right)

    def steady(self) -> bool:
        """Whether MuJoCo has warned of nothing."""
        return not any(warning.number for warning in self.data.warning) and bool(np.isfinite(self.data.qpos).all())


def _lay(model: Any, data: Any, position: FloatArray) -> None:
    """Put the particles where they are, with no bend that strives to open."""
    import mujoco

    bodies = model.flex_vertbodyid
    first = model.jnt_qposadr[model.body_jntadr[bodies]]
    for axis in range(3):
        data.qpos[first + axis] = position[:, axis] - model.body_pos[bodies, axis]
    laid, yields = data.qpos.copy(), model.flex_yield.copy()
    # A step in which every bend yields at once makes the present bends those of rest.
    model.flex_yield[:, 1] = 0.0
    mujoco.mj_step(model, data)
    model.flex_yield[:] = yields
    data.qpos[:], data.qvel[:], data.time = laid, 0.0, 0.0
    mujoco.mj_forward(model, data)


def _path(gripper: Gripper, shell: Shell) -> Iterator[tuple[float, float]]:
    """Height of the tips against `ABOVE` and how far each finger has closed, step by step, as in `pscover.sim.arm`."""
    down, up, way = gripper.tip - ABOVE, gripper.lift - ABOVE, (gripper.opening - gripper.closed) / 2
    for _ in _steps(shell.settle, shell):
        yield 0.0, 0.0
    for u in _steps(1.3 * -down / SPEED, shell):
        yield down * _smooth(u), 0.0
    closing = 1.15 * 2 * way / CLOSING
    for u in _steps(closing, shell):
        yield down, min(way, u * closing * CLOSING / 2)
    for u in _steps(1.3 * (up - down) / SPEED, shell):
        yield down + (up - down) * _smooth(u), way
    for _ in _steps(0.15, shell):
        yield up, way


def _steps(seconds: float, shell: Shell) -> FloatArray:
    count = max(1, round(seconds / shell.step))
    return (1.0 + np.arange(count)) / count


def _smooth(u: float) -> float:
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


def scene(world: World, garments: Sequence[int], x: float, y: float, theta: float, shell: Shell) -> str:
    """The model in MuJoCo's format: table, floor, jaw above a point, and garments that lie flat at the origin."""
    gripper, material = world.settings.gripper, world.settings.material
    puff = world.arm.law.thickness / 2 - shell.radius
    touch = 'condim="3" solref="0.01 1"'
    return f"""<mujoco>
<option timestep="{shell.step}" integrator="discrete" solver="CG" iterations="{shell.iterations}" tolerance="1e-6"
 cone="elliptic" impratio="5"/>
<size memory="400M"/>
<worldbody>
<geom type="box" pos="{TABLE[0] / 2} {TABLE[1] / 2} {(puff + FLOOR) / 2}" {touch} friction="{material.table_friction}"
 size="{TABLE[0] / 2 + puff} {TABLE[1] / 2 + puff} {(puff - FLOOR) / 2}"/>
<geom type="plane" pos="0 0 {FLOOR + puff}" size="4 4 1" {touch} friction="{material.table_friction}"/>
<body pos="{x} {y} {ABOVE}" quat="{math.cos(theta / 2)} 0 0 {math.sin(theta / 2)}" gravcomp="1">
<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/><joint name="hand" type="slide" axis="0 0 1"/>
{_finger("left", -1, gripper, puff, f'{touch} friction="{material.finger_friction}"')}
{_finger("right", 1, gripper, puff, f'{touch} friction="{material.finger_friction}"')}
</body>
{"".join(_garment(world, g, shell, f'{touch} friction="{material.cloth_friction}"') for g in garments)}
</worldbody>
<equality><joint joint1="left" joint2="right"/></equality>
<actuator>
<position joint="hand" kp="{HOLD[0]}" kv="{HOLD[1]}"/>
<position joint="left" kp="{PRESS[0]}" kv="{PRESS[1]}" forcerange="{-gripper.force} {gripper.force}"/>
<position joint="right" kp="{PRESS[0]}" kv="{PRESS[1]}" forcerange="{-gripper.force} {gripper.force}"/>
</actuator>
</mujoco>"""


def _finger(name: str, side: int, gripper: Gripper, puff: float, touch: str) -> str:
    half = gripper.finger / 2, gripper.width / 2, gripper.height / 2
    size = " ".join(f"{one + puff}" for one in half)
    return f"""<body pos="{side * (gripper.opening / 2 + half[0])} 0 0" gravcomp="1">
<joint name="{name}" type="slide" axis="{-side} 0 0" limited="true" range="-0.001 {(gripper.opening - gripper.closed) / 2}"/>
<geom type="box" pos="0 0 {half[2]}" size="{size}" mass="0.05" contype="2" {touch}/></body>"""


def _garment(world: World, garment: int, shell: Shell, touch: str) -> str:
    mesh = meshes(world.garments[garment : garment + 1], world.settings.material.spacing)[0]
    cloth, thickness = world.cloth, shell.thickness
    mass = float(cloth.mass[cloth.start[garment] : cloth.start[garment + 1]].sum())
    points = " ".join(f"{px:.7g} {py:.7g} 0" for px, py in mesh.corners.tolist())
    triangles = " ".join(map(str, mesh.triangles.ravel().tolist()))
    return f"""<flexcomp name="g{garment}" type="direct" dim="2" radius="{shell.radius}" mass="{mass}"
 point="{points}" element="{triangles}"><contact selfcollide="auto" {touch}/>
<elasticity young="{shell.stretch / thickness}" poisson="{POISSON}" thickness="{thickness}" damping="{shell.damping}"
 elastic2d="both" yield="0 {thickness / 2 * shell.yields}"/></flexcomp>
"""

"""The state of the world: particles, what joins them, and the laws that they obey."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pscover.sim.mesh import Mesh, area, triangulated
from pscover.sim.settings import TABLE, Material
from pscover.sim.wardrobe import Garment

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


class Cloth(NamedTuple):
    """All garments; what belongs to garment g lies between `start[g]` and `start[g + 1]`.

    Parameters
    ----------
    position, velocity, before
        Shape (particles, 3); `before` is the position at the beginning of the step.
    mass, mobility
        Shape (particles,): kilograms, and 1 / mass, or 0 while something else decides where the particle is.
    garment
        Shape (particles,): the index of the garment.
    flat
        Shape (particles, 2): where the particle is when the garment lies flat, metres.
    start, edge_start, hinge_start
        Shape (garments + 1,).
    edge, edge_length
        Neighbours, shape (edges, 2), and their distance.
    hinge, hinge_length, hinge_flat
        Particles on both sides of an edge, shape (hinges, 2), the distance at which they rest, and that of flat cloth.
    present
        Shape (garments,): 0 once the garment is gone.
    asleep
        Shape (garments,): 1 while a garment lies still and is left out until something moves against it.
    anchor
        Where particles were when last looked at for whether they lie still, shape (particles, 3).
    age
        Shape (1,): steps since the beginning.
    """

    position: FloatArray
    velocity: FloatArray
    before: FloatArray
    mass: FloatArray
    mobility: FloatArray
    garment: IntArray
    flat: FloatArray
    start: IntArray
    edge: IntArray
    edge_start: IntArray
    edge_length: FloatArray
    hinge: IntArray
    hinge_start: IntArray
    hinge_length: FloatArray
    hinge_flat: FloatArray
    present: NDArray[np.uint8]
    asleep: NDArray[np.uint8]
    anchor: FloatArray
    age: NDArray[np.int64]


class Law(NamedTuple):
    """The numbers of a step: lengths in metres, times in seconds.

    Parameters
    ----------
    dt
        Length of a step.
    thickness
        Distance at which particles touch; half of it is a particle's radius.
    skin
        How much further than the thickness pairs are remembered.
    apart
        Particles of one garment that are nearer to each other in flat cloth never touch.
    cloth_friction, table_friction, finger_friction
        Coefficients of Coulomb friction.
    bending, fold
        See `pscover.sim.settings.Material`.
    kept
        Part of the velocity that the air leaves in a step.
    gravity_x, gravity_y, gravity_z
        Metres a second squared.
    table_x, table_y
        Size of the table, which begins at (0, 0).
    """

    dt: float
    thickness: float
    skin: float
    apart: float
    cloth_friction: float
    table_friction: float
    finger_friction: float
    bending: float
    fold: float
    kept: float
    gravity_x: float
    gravity_y: float
    gravity_z: float
    table_x: float
    table_y: float


def law(material: Material) -> Law:
    """The laws for a material on the workspace."""
    dt = 1.0 / material.rate
    return Law(
        dt=dt,
        thickness=material.thickness * material.spacing,
        skin=0.3 * material.spacing,
        apart=1.2 * material.spacing,
        cloth_friction=material.cloth_friction,
        table_friction=material.table_friction,
        finger_friction=material.finger_friction,
        bending=material.bending,
        fold=material.fold,
        kept=1.0 - material.drag * dt,
        gravity_x=0.0,
        gravity_y=0.0,
        gravity_z=-9.81,
        table_x=TABLE[0],
        table_y=TABLE[1],
    )


def meshes(garments: Sequence[Garment], spacing: float) -> tuple[Mesh, ...]:
    """The triangles of each garment."""
    return tuple(triangulated(garment.outline, spacing) for garment in garments)


def cloth(garments: Sequence[Garment], spacing: float, *, seed: int = 0) -> Cloth:
    """Garments lying flat side by side at the origin, at rest; nothing else is decided here.

    Parameters
    ----------
    garments
        Which.
    spacing
        Metres between particles.
    seed
        Of the order in which edges are treated, so that it follows no direction of the grid.

    Examples
    --------
    >>> from pscover.sim.wardrobe import wardrobe
    >>> state = cloth(wardrobe(0.75), 0.02)
    >>> bool(abs(state.mass.sum() - 0.293) < 0.01), len(state.present)
    (True, 10)
    """
    generator = np.random.default_rng(seed)
    flat, mass, edge, hinge = [], [], [], []
    start = [0]
    for garment, mesh in zip(garments, meshes(garments, spacing), strict=True):
        n = len(mesh.corners)
        ends, opposite = mesh.sides
        flat.append(mesh.corners)
        mass.append(np.full(n, garment.density * area(garment.outline) / n))
        edge.append(generator.permutation(ends) + start[-1])
        hinge.append(generator.permutation(opposite[opposite[:, 1] >= 0]) + start[-1])
        start.append(start[-1] + n)
    plane = np.concatenate(flat)
    edges, hinges = np.concatenate(edge).astype(np.int32), np.concatenate(hinge).astype(np.int32)
    masses, n = np.concatenate(mass), start[-1]
    hinge_flat = np.linalg.norm(plane[hinges[:, 0]] - plane[hinges[:, 1]], axis=1)
    position = np.zeros((n, 3))
    position[:, :2] = plane
    return Cloth(
        position=position,
        velocity=np.zeros((n, 3)),
        before=position.copy(),
        mass=masses,
        mobility=1.0 / masses,
        garment=np.repeat(np.arange(len(garments)), np.diff(start)).astype(np.int32),
        flat=plane,
        start=np.array(start, dtype=np.int32),
        edge=edges,
        edge_start=_starts(edge),
        edge_length=np.linalg.norm(plane[edges[:, 0]] - plane[edges[:, 1]], axis=1),
        hinge=hinges,
        hinge_start=_starts(hinge),
        hinge_length=hinge_flat.copy(),
        hinge_flat=hinge_flat,
        present=np.ones(len(garments), dtype=np.uint8),
        asleep=np.zeros(len(garments), dtype=np.uint8),
        anchor=position.copy(),
        age=np.zeros(1, dtype=np.int64),
    )


def _starts(parts: Sequence[NDArray[np.int64]]) -> IntArray:
    return np.concatenate(([0], np.cumsum([len(part) for part in parts]))).astype(np.int32)

"""The smooth surface of every garment, for pictures and for the truth: particles as corners of fine triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array

from pscover.sim.cloth import Cloth, FloatArray, IntArray, meshes
from pscover.sim.mesh import Mesh, smoothed
from pscover.sim.raster import draw, pile
from pscover.sim.settings import Material
from pscover.sim.view import Projection
from pscover.sim.wardrobe import Garment

SUNK = 0.35
"""Part of the particles' thickness by which cloth is drawn below them: they stand further apart than cloth is thick."""
LAYERS = 40
"""Most layers above one pixel that are counted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """Fine triangles of all garments.

    Parameters
    ----------
    weights
        Corners are `weights @ particles`, shape (corners, particles).
    triangles
        Shape (triangles, 3).
    garment
        Of each triangle.
    flat
        Place of each corner in flat cloth, shape (corners, 2).
    sunk
        Metres by which the surface lies lower than the particles.
    """

    weights: csr_array
    triangles: IntArray
    garment: IntArray
    flat: FloatArray
    sunk: float

    @classmethod
    def of(cls, garments: Sequence[Garment], material: Material, rounds: int = 2) -> Surface:
        """Subdivide the triangles of the physics so many times."""
        spacing = material.spacing
        weights, triangles, owner, flat = [], [], [], []
        corners = 0
        for index, mesh in enumerate(meshes(garments, spacing)):
            matrix, fine = smoothed(mesh)
            for _ in range(rounds - 1):
                finer, faces = smoothed(Mesh(corners=matrix @ mesh.corners, triangles=fine))
                matrix, fine = csr_array(finer @ matrix), faces
            weights.append(matrix)
            triangles.append(fine + corners)
            owner.append(np.full(len(fine), index, dtype=np.int32))
            flat.append(matrix @ mesh.corners)
            corners += matrix.shape[0]
        return cls(
            weights=csr_array(block_diag(weights, format="csr")),
            triangles=np.concatenate(triangles).astype(np.int32),
            garment=np.concatenate(owner),
            flat=np.concatenate(flat),
            sunk=SUNK * material.thickness * spacing,
        )

    def corners(self, cloth: Cloth) -> FloatArray:
        """Where the corners are now, shape (corners, 3)."""
        corners = np.asarray(self.weights @ cloth.position)
        corners[:, 2] -= self.sunk
        return corners

    def shown(self, cloth: Cloth) -> FloatArray:
        """1.0 for triangles of garments that are present."""
        return cloth.present[self.garment].astype(np.float64)

    def labels(self, cloth: Cloth, projection: Projection) -> tuple[IntArray, FloatArray]:
        """What is seen: 0 for the surface or 1 + garment, and its distance along the optical axis, infinite for nothing."""
        nearest, which, _ = buffers(projection.shape)
        inside = np.empty((*projection.shape, 2))
        draw(projection.screen(self.corners(cloth)), self.triangles, self.shown(cloth), nearest, which, inside)
        return np.where(which >= 0, self.garment[which] + 1, 0).astype(np.int32), nearest

    def layers(self, cloth: Cloth, projection: Projection) -> NDArray[np.int8]:
        """Every layer of cloth above each pixel, the lowest first: 1 + garment, 0 above the last; shape (layers, H, W)."""
        depth = np.zeros((LAYERS, *projection.shape))
        owner = np.zeros((LAYERS, *projection.shape), dtype=np.int8)
        pile(projection.screen(self.corners(cloth)), self.triangles, self.garment, self.shown(cloth), depth, owner)
        return owner[: int(np.count_nonzero(owner.any(axis=(1, 2))))]


def buffers(shape: tuple[int, int]) -> tuple[FloatArray, IntArray, FloatArray]:
    """Empty images for `pscover.sim.raster.draw`: nothing is seen."""
    return np.full(shape, np.inf), np.full(shape, -1, dtype=np.int32), np.zeros((*shape, 2))

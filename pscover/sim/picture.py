"""A picture of the world from any side: what is seen, how far it is, and in which light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.sim.cloth import Cloth, FloatArray
from pscover.sim.fabric import Atlas, garment_textures
from pscover.sim.fingers import Hand
from pscover.sim.light import CELL, Light, light
from pscover.sim.raster import draw, normals
from pscover.sim.scenery import fingers, furniture, joined, textures
from pscover.sim.settings import TABLE, WorldSettings
from pscover.sim.shade import Bodies, Paint, shade
from pscover.sim.surface import Surface, buffers
from pscover.sim.view import Projection
from pscover.sim.wardrobe import Garment

FINER = 2
"""Each pixel is the mean of so many by so many."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """Light and distance.

    Parameters
    ----------
    light
        Linear, shape (H, W, 3); 1.0 is white.
    depth
        Metres along the optical axis, shape (H, W), infinite where nothing is.
    """

    light: NDArray[np.float32]
    depth: FloatArray

    def rgb(self) -> NDArray[np.uint8]:
        """As a camera stores it, 8 bits."""
        return (255.0 * np.clip(self.light, 0.0, 1.0) ** (1 / 2.2) + 0.5).astype(np.uint8)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Painter:
    """Paints the garments of one world.

    Parameters
    ----------
    surface
        Their triangles.
    paint
        Two textures a garment, front and back, then those of the scenery.
    garments
        How many.
    settings
        Where the basket is.
    """

    surface: Surface
    paint: Paint
    garments: int
    settings: WorldSettings

    @classmethod
    def of(cls, garments: Sequence[Garment], surface: Surface, settings: WorldSettings) -> Painter:
        """Weave the fabrics."""
        pairs = [garment_textures(garment, seed) for seed, garment in enumerate(garments)]
        atlas = Atlas.of([*(side for pair in pairs for side in pair), *textures()])
        paint = Paint(atlas.colour, atlas.slope, atlas.place, atlas.origin)
        return cls(surface=surface, paint=paint, garments=len(garments), settings=settings)

    def picture(self, cloth: Cloth, projection: Projection, hand: Hand | None = None) -> Picture:
        """What is seen; the fingers too, if given."""
        corners = self.surface.corners(cloth)
        facing = np.empty_like(corners)
        normals(corners, self.surface.triangles, facing)
        shown = self.surface.shown(cloth)
        lit = self._light(corners, shown)
        bodies, shown = self._bodies(corners, facing, shown, hand)
        fine = projection.finer(FINER)
        nearest, which, inside = buffers(fine.shape)
        draw(fine.screen(bodies.corners), bodies.triangles, shown, nearest, which, inside)
        out = np.full((*projection.shape, 3), 0.05, dtype=np.float32)
        shade(which, inside, bodies, self.paint, lit, projection.eye, out, np.empty((4, 3)))
        return Picture(light=out, depth=nearest[::FINER, ::FINER])

    def _light(self, corners: FloatArray, shown: FloatArray) -> Light:
        columns, rows = (round(side / CELL) for side in TABLE)
        nearest, which, inside = buffers((rows, columns))
        top = 10.0
        above = np.column_stack((corners[:, 0] / CELL - 0.5, corners[:, 1] / CELL - 0.5, top - corners[:, 2]))
        draw(above, self.surface.triangles, shown, nearest, which, inside)
        return light(np.where(which >= 0, top - nearest, 0.0))

    def _bodies(
        self, corners: FloatArray, facing: FloatArray, shown: FloatArray, hand: Hand | None
    ) -> tuple[Bodies, FloatArray]:
        solid, upright, texture = joined(furniture(self.settings.basket) + (fingers(hand) if hand is not None else []))
        count = len(texture)
        texture = texture + np.int32(2 * self.garments)
        owner = self.surface.garment
        bodies = Bodies(
            corners=np.concatenate((corners, solid)),
            normals=np.concatenate((facing, upright)),
            place=np.concatenate((self.surface.flat, solid[:, :2])),
            triangles=np.concatenate(
                (self.surface.triangles, (len(corners) + np.arange(3 * count)).reshape(-1, 3).astype(np.int32))
            ),
            front=np.concatenate((2 * owner, texture)).astype(np.int32),
            back=np.concatenate((2 * owner + 1, texture)).astype(np.int32),
        )
        return bodies, np.concatenate((shown, np.ones(count)))

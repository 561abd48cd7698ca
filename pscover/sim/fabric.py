"""What fabrics look like: images of colours and of fine slopes, painted once for each garment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from pscover.sim.mesh import distance, inside
from pscover.sim.settings import TABLE
from pscover.sim.wardrobe import Colour, Fabric, Garment

FloatArray = NDArray[np.float64]

GRAIN = 0.0015
"""Metres a texel."""
MARGIN = 0.01
"""Metres of a texture beyond the garment's outline."""
HEM = 0.012
"""Metres from the edge to the line of stitches."""
WOOD: Colour = (206, 196, 178)
"""The table."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Texture:
    """An image on a surface.

    Parameters
    ----------
    colour
        8-bit RGB, shape (rows, columns, 3).
    slope
        Of the fine relief along x and y, shape (rows, columns, 2).
    origin
        Metres of the first texel.
    """

    colour: NDArray[np.uint8]
    slope: NDArray[np.float32]
    origin: tuple[float, float]


def plain(colour: Colour) -> Texture:
    """One colour, smooth."""
    flat = np.array(colour, dtype=np.uint8).reshape(1, 1, 3)
    return Texture(colour=flat, slope=np.zeros((1, 1, 2), dtype=np.float32), origin=(0.0, 0.0))


def garment_textures(garment: Garment, seed: int) -> tuple[Texture, Texture]:
    """The front and the back of a garment."""
    low = garment.outline.min(axis=0) - MARGIN
    columns, rows = np.ceil((garment.outline.max(axis=0) + MARGIN - low) / GRAIN).astype(int)
    x, y = low[0] + GRAIN * np.arange(columns), low[1] + GRAIN * np.arange(rows)
    points = np.column_stack((np.tile(x, rows), np.repeat(y, columns)))
    from_edge = np.where(inside(garment.outline, points), distance(garment.outline, points), 0.0).reshape(rows, columns)
    generator = np.random.default_rng([seed, 5])
    front = _painted(garment.fabric, x, y, front=True)
    back = _painted(garment.fabric, x, y, front=False)
    relief = _relief(garment.fabric, x, y, generator)
    shade = _wear(from_edge, generator)
    slope = np.stack((np.gradient(relief, GRAIN, axis=1), np.gradient(relief, GRAIN, axis=0)), axis=2).astype(np.float32)
    return tuple(  # type: ignore[return-value]
        Texture(colour=np.clip(side * shade, 0, 255).astype(np.uint8), slope=slope, origin=(float(low[0]), float(low[1])))
        for side in (front, back)
    )


def _painted(fabric: Fabric, x: FloatArray, y: FloatArray, *, front: bool) -> FloatArray:
    """The pattern, shape (rows, columns, 3)."""
    part = _second(fabric, x[None, :], y[:, None], front=front)[..., None]
    ground, second = np.array(fabric.colour, dtype=float), np.array(fabric.second, dtype=float)
    colour: FloatArray = (1 - part) * ground + part * second
    return colour


def _second(fabric: Fabric, x: FloatArray, y: FloatArray, *, front: bool) -> FloatArray:
    """How much of the second colour there is, in [0, 1], shape (rows, columns)."""
    u, v = x / fabric.pitch, y / fabric.pitch
    part: FloatArray = np.zeros((y.shape[0], x.shape[1]))
    match fabric.pattern:
        case "stripes":
            part += np.mod(v, 1.0) < 0.3
        case "checks":
            part += 0.5 * (np.mod(u, 1.0) < 0.45) + 0.5 * (np.mod(v, 1.0) < 0.45)
        case "dots":
            odd = np.floor(v * 2) % 2
            part += np.hypot(np.mod(u + odd / 2, 1.0) - 0.5, (np.mod(v * 2, 1.0) - 0.5) / 2) < 0.16
        case "ribs":
            part += 0.5 + 0.5 * np.sin(2 * np.pi * u)
        case "terry":
            part += 0.9 * (np.abs(np.abs(y) - 0.42 * np.ptp(y)) < 0.012)
        case "print" if front:
            ring = np.hypot(x, y + 0.06 * np.ptp(y) / 0.4)
            part += (ring < 0.06) & ~((ring > 0.028) & (ring < 0.038))
        case _:
            pass
    return part


def _relief(fabric: Fabric, x: FloatArray, y: FloatArray, generator: np.random.Generator) -> FloatArray:
    """Heights in metres of creases and of the weave."""
    shape = (len(y), len(x))
    relief = np.zeros(shape)
    for width, height in ((0.012, 0.0011), (0.006, 0.0005)):
        noise = gaussian_filter(generator.standard_normal(shape), width / GRAIN)
        # Creases are sharp above and round below.
        relief -= height * np.abs(noise / noise.std())
    coarse = {"terry": 0.00025, "ribs": 0.00005}.get(fabric.pattern, 0.00008)
    relief += coarse * generator.standard_normal(shape)
    if fabric.pattern == "ribs":
        relief += 0.0007 * np.cos(2 * np.pi * x / fabric.pitch)[None, :]
    smooth: FloatArray = gaussian_filter(relief, 0.7)
    return smooth


def _wear(from_edge: FloatArray, generator: np.random.Generator) -> FloatArray:
    """How light the cloth is: uneven dye, and the dark lines of hems, shape (rows, columns, 1)."""
    dye = gaussian_filter(generator.standard_normal(from_edge.shape), 0.03 / GRAIN)
    shade = 1.0 + 0.025 * dye / dye.std() + 0.03 * generator.standard_normal(from_edge.shape)
    shade *= np.where(np.abs(from_edge - HEM) < 0.0015, 0.82, 1.0)
    worn: FloatArray = (shade * np.where(from_edge < 0.003, 0.8, 1.0))[..., None]
    return worn


@cache
def table_texture() -> Texture:
    """Pale wood, its grain along the table."""
    generator = np.random.default_rng(11)
    columns, rows = (round(side / GRAIN) + 1 for side in TABLE)
    fine = gaussian_filter(generator.standard_normal((rows, columns)), (0.8, 40))
    broad = gaussian_filter(generator.standard_normal((rows, columns)), (5, 150))
    shade = 1.0 + 0.012 * fine / fine.std() + 0.012 * broad / broad.std()
    colour = np.clip(np.array(WOOD, dtype=float) * shade[..., None], 0, 255).astype(np.uint8)
    return Texture(colour=colour, slope=np.zeros((rows, columns, 2), dtype=np.float32), origin=(0.0, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Atlas:
    """Many textures in two arrays.

    Parameters
    ----------
    colour
        Light that is sent back, linear, shape (texels, 3).
    slope
        Shape (texels, 2).
    place
        First texel, rows and columns of each texture, shape (textures, 3).
    origin
        Shape (textures, 2).
    """

    colour: NDArray[np.float32]
    slope: NDArray[np.float32]
    place: NDArray[np.int32]
    origin: FloatArray

    @classmethod
    def of(cls, textures: Sequence[Texture]) -> Atlas:
        """All of them, in this order."""
        sizes = [texture.colour.shape[:2] for texture in textures]
        first = np.concatenate(([0], np.cumsum([rows * columns for rows, columns in sizes])))
        colour = np.concatenate([texture.colour.reshape(-1, 3) for texture in textures])
        return cls(
            colour=((colour / 255.0) ** 2.2).astype(np.float32),
            slope=np.concatenate([texture.slope.reshape(-1, 2) for texture in textures]),
            place=np.array([(at, *size) for at, size in zip(first, sizes, strict=False)], dtype=np.int32),
            origin=np.array([texture.origin for texture in textures], dtype=np.float64),
        )

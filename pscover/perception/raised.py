"""Cloth by its height: what rises above the table is no table, whatever its colour."""

from __future__ import annotations

from pscover.perception.cloth import ClothMap, ClothSettings, majority
from pscover.perception.depth import HeightMap


def raised(cloth: ClothMap, heights: HeightMap | None, centimetres: float, settings: ClothSettings) -> ClothMap:
    """The map with every pixel as cloth that lies so high; by colour alone without heights, or at 0 centimetres.

    Heights are smoothed as colours are, by the paper's two convolutions. What lies lower stays what its colour says: cloth
    may be thinner than a camera can see.

    Parameters
    ----------
    cloth
        By colour.
    heights
        Of the same shape.
    centimetres
        The height from which a pixel is cloth.
    settings
        Kernel and rounds of the convolution.
    """
    if heights is None or not centimetres:
        return cloth
    high = majority(heights.metres > centimetres / 100, settings.kernel, settings.rounds)
    return cloth.with_cloth(cloth.cloth | high)

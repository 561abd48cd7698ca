"""The ten garments of a scene: outlines of an adult's clothes lying flat, what they weigh and how they look."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pscover.generate.outlines import SHAPES

FloatArray = NDArray[np.float64]
Pattern = Literal["plain", "print", "stripes", "checks", "dots", "ribs", "terry"]
Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fabric:
    """How a garment looks.

    Parameters
    ----------
    colour, second
        Of the ground and of the pattern, 8-bit RGB.
    pattern
        Which one.
    pitch
        Metres from one repeat of the pattern to the next.
    """

    colour: Colour
    second: Colour = (255, 255, 255)
    pattern: Pattern = "plain"
    pitch: float = 0.05


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Garment:
    """One garment.

    Parameters
    ----------
    name
        What it is called.
    outline
        Closed polygon in metres, shape (corners, 2), y down.
    density
        Kilograms a square metre of the outline: both layers of a shirt together.
    fabric
        How it looks.
    """

    name: str
    outline: FloatArray
    density: float
    fabric: Fabric


def _sleeved() -> FloatArray:
    half = [(0, 28), (21, 28), (21, -12), (31, 22), (40, 19), (26, -24), (9, -28), (5, -23), (0, -22)]
    right = np.array(half, dtype=float)
    return np.concatenate((right, right[::-1] * (-1, 1)))


def _hat() -> FloatArray:
    arc = np.linspace(0, np.pi, 11)
    crown = np.column_stack((12 * np.cos(arc), -5 - 14 * np.sin(arc)))
    return np.concatenate((np.array([(-12.5, 8.0), (12.5, 8.0), (12.5, 2.0)]), crown, np.array([(-12.5, 2.0)])))


def _glove() -> FloatArray:
    corners = [(-4.5, 11), (4.5, 11), (5, 3), (10, -2), (8.5, -5), (4.5, -2), (4.5, -11), (0, -12.5), (-4.5, -10), (-5, 3)]
    return np.array(corners, dtype=float)


def _towel() -> FloatArray:
    return np.array([(-17, -22), (17, -22), (17, 22), (-17, 22)], dtype=float)


def wardrobe(scale: float = 1.0) -> tuple[Garment, ...]:
    """The ten garments at a scale.

    Two are blue and two are dark grey, as like as clothes of one house are.

    Examples
    --------
    >>> [garment.name for garment in wardrobe()][:3], len(wardrobe())
    (['t-shirt', 'long sleeve', 'shorts'], 10)
    """
    sock = SHAPES["sock"]
    known = [
        ("t-shirt", SHAPES["t-shirt"], 0.34, Fabric(colour=(176, 42, 38), second=(214, 150, 130), pattern="print")),
        (
            "long sleeve",
            _sleeved(),
            0.45,
            Fabric(colour=(38, 60, 118), second=(150, 160, 184), pattern="stripes", pitch=0.022),
        ),
        ("shorts", SHAPES["shorts"], 0.50, Fabric(colour=(74, 96, 66), second=(62, 82, 56), pattern="plain")),
        ("scarf", SHAPES["scarf"], 0.40, Fabric(colour=(196, 148, 52), second=(158, 96, 44), pattern="checks", pitch=0.04)),
        ("hat", _hat(), 0.60, Fabric(colour=(110, 52, 122), second=(92, 40, 104), pattern="ribs", pitch=0.012)),
        ("glove", _glove(), 0.50, Fabric(colour=(48, 49, 54), second=(38, 39, 44), pattern="ribs", pitch=0.010)),
        ("sock", sock, 0.45, Fabric(colour=(206, 138, 158), second=(226, 190, 200), pattern="stripes", pitch=0.02)),
        ("grey sock", sock * 1.15, 0.45, Fabric(colour=(92, 94, 102), second=(80, 82, 90), pattern="ribs", pitch=0.010)),
        (
            "underwear",
            SHAPES["underwear"],
            0.35,
            Fabric(colour=(44, 132, 140), second=(150, 190, 190), pattern="dots", pitch=0.024),
        ),
        ("towel", _towel(), 0.40, Fabric(colour=(70, 104, 164), second=(150, 170, 204), pattern="terry", pitch=0.30)),
    ]
    return tuple(
        Garment(name=name, outline=np.ascontiguousarray(outline) * (0.01 * scale), density=density, fabric=fabric)
        for name, outline, density, fabric in known
    )

"""Which pixels show cloth: those whose colour is not the surface's, smoothed by the paper's two convolutions (section 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings
from pscover.perception.background import Auto, Background
from pscover.perception.colour import FloatImage, Photo, opencv, smooth_lab
from pscover.perception.grid import Grid
from pscover.perception.mask import Mask
from pscover.perception.surface import Surface, fit_surface

BoolImage = NDArray[np.bool_]
LIGHT, NOISE = 75.0, 4.0
"""L of a surface on which the threshold is as given, and its least multiple of the surface's median distance."""
BIN, SMOOTH, REACH = 0.25, 0.75, 2.0
"""Distances are counted in bins this wide, smoothed by so much, and looked at so far beyond the threshold."""
RISE, FEW = 2.0, 5.0
"""Beyond a valley, distances are this many times as common as in it, where so many pixels a bin count as none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClothSettings:
    """How cloth is told from the surface.

    Parameters
    ----------
    threshold
        Colour distance from which a pixel is cloth, on a surface of L = 75 or more; on a darker one, or in less light, all
        distances are smaller, and so is the threshold, in proportion, but not below four times the surface's noise (the
        median distance of what is below the threshold). Where a garment is paler than that, so that distances are rare at
        first and then common again below the threshold, it is where they are rarest. The distance is that of CIE Lab with
        L weighted by `lightness`.
    lightness
        Weight of L; less than 1, for a shadow on the surface is darker, not of another colour.
    median
        Side in pixels of the median filter before colours are compared; odd, 1 for none.
    kernel
        Side in pixels of the all-ones kernel of the paper's convolution; odd, 1 for none.
    rounds
        How often it is applied; the paper's two.
    thinnest
        What is nowhere so many pixels wide is a line of the surface (a joint between boards, a cable, the grout of tiles)
        unless it lies as near to something that is; 1 to keep all.
    decision
        "pixel" (the paper): each pixel by its colour. "mask": each mask of the segmenter as a whole, for garments of the
        surface's colour that a segmenter sees by their outlines, such as white socks on a white sheet.
    surface_share
        A mask of more than this share of the region may be surface ("mask" only).
    surface_sides
        A mask that touches so many of the region's four sides may be surface ("mask" only).

    Raises
    ------
    InvalidSettings
        If a setting is outside its domain.
    """

    threshold: float = 14.0
    lightness: float = 0.5
    median: int = 5
    kernel: int = 7
    rounds: int = 2
    thinnest: int = 7
    decision: Literal["pixel", "mask"] = "pixel"
    surface_share: float = 0.1
    surface_sides: int = 2

    def __post_init__(self) -> None:
        for name, value, highest in (
            ("threshold", self.threshold, 500), ("lightness", self.lightness, 10), ("surface_share", self.surface_share, 1),
        ):  # fmt: skip
            if not (math.isfinite(value) and 0 <= value <= highest):
                raise InvalidSettings(f"{name}: expected a number from 0 to {highest}, got {value!r}")
        for name, side in (("median", self.median), ("kernel", self.kernel), ("thinnest", self.thinnest)):
            if not (1 <= side <= 255 and side % 2 == 1):
                raise InvalidSettings(f"{name}: expected an odd number of pixels from 1 to 255, got {side!r}")
        if not 0 <= self.rounds <= 100:
            raise InvalidSettings(f"rounds: expected a whole number from 0 to 100, got {self.rounds!r}")
        if self.decision not in ("pixel", "mask"):
            raise InvalidSettings(f'decision: expected "pixel" or "mask", got {self.decision!r}')
        if not 1 <= self.surface_sides <= 5:
            raise InvalidSettings(f"surface_sides: expected a whole number from 1 to 5, got {self.surface_sides!r}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClothMap:
    """Where cloth lies. Every buffer is read-only.

    Parameters
    ----------
    cloth
        True where a pixel shows cloth, shape (H, W); False outside the region of interest.
    distance
        Colour distance to the surface, shape (H, W).
    inside
        The region of interest, shape (H, W).
    surface
        The model of the surface.
    threshold
        The distance from which a pixel was taken for cloth.
    """

    cloth: BoolImage
    distance: FloatImage
    inside: BoolImage
    surface: Surface
    threshold: float

    @property
    def share(self) -> float:
        """Cloth pixels as a share of the region's."""
        return int(np.count_nonzero(self.cloth)) / max(1, int(np.count_nonzero(self.inside)))

    def with_cloth(self, cloth: BoolImage) -> ClothMap:
        """The same map with another decision."""
        return replace(self, cloth=_frozen(cloth & self.inside))


def cloth_map(
    photo: Photo,
    background: Background | None = None,
    *,
    inside: BoolImage | None = None,
    grid: Grid | None = None,
    settings: ClothSettings | None = None,
) -> ClothMap:
    """Cloth and surface told apart by colour, pixel by pixel.

    Parameters
    ----------
    photo
        RGB on the grid, shape (H, W, 3).
    background
        What is known of the surface; by default its colour is taken from the border of the region.
    inside
        The region of interest, shape (H, W); by default the whole image.
    grid
        Where the photo comes from; by default it is the photo itself.
    settings
        Thresholds and kernel sizes.

    Examples
    --------
    >>> photo = np.full((40, 60, 3), 200, dtype=np.uint8)
    >>> photo[10:30, 20:40] = 200, 0, 0
    >>> cloth = cloth_map(photo).cloth
    >>> bool(cloth[20, 30]), bool(cloth[5, 5]), int(cloth.sum())
    (True, False, 360)
    """
    using = settings or ClothSettings()
    shape = photo.shape[0], photo.shape[1]
    region = np.ones(shape, dtype=np.bool_) if inside is None else inside
    image = smooth_lab(photo, using.median)
    surface = fit_surface(
        image,
        region,
        background or Auto(),
        grid or Grid(photo_shape=shape, shape=shape),
        lightness=using.lightness,
        median=using.median,
    )
    distance = surface.distance(image)
    distance.setflags(write=False)
    threshold = _threshold(using.threshold, surface.lightness, distance[region])
    cloth = majority((distance > threshold) & region, using.kernel, using.rounds, inside=region)
    cloth = without_lines(cloth, using.thinnest)
    return ClothMap(cloth=_frozen(cloth), distance=distance, inside=_frozen(region), surface=surface, threshold=threshold)


def _threshold(highest: float, lightness: float, distances: FloatImage) -> float:
    """Between the noise of the surface and the palest garment: see `ClothSettings.threshold`."""
    ground = distances[distances < highest]
    least = NOISE * (float(np.median(ground)) if len(ground) else 0.0)
    usual = min(highest, max(highest * lightness / LIGHT, least))
    return min(usual, _valley(distances, least, usual))


def _valley(distances: FloatImage, low: float, high: float) -> float:
    """The distance from `low` to `high` beyond which distances become most times as common again; `high` if none do."""
    from scipy.ndimage import gaussian_filter1d

    bins = math.ceil((high + REACH) / BIN)
    counts, edges = np.histogram(distances, bins=bins, range=(0, bins * BIN))
    density = gaussian_filter1d(counts.astype(float), SMOOTH / BIN) + FEW
    beyond = np.maximum.accumulate(density[::-1])[::-1]
    middles = edges[:-1] + BIN / 2
    rise = np.where((middles >= low) & (middles <= high), beyond / density, 0.0)
    return float(middles[rise.argmax()]) if rise.max() >= RISE else high


def majority(bits: BoolImage, kernel: int, rounds: int = 2, *, inside: BoolImage | None = None) -> BoolImage:
    """The paper's clean-up: a convolution with an all-ones kernel, each pixel set where more than half of it is set.

    Fills holes and removes specks. At the edge of the region only the pixels within count: what lies beyond is not known,
    and to repeat the last ones would make a joint along the edge as wide as cloth.

    Parameters
    ----------
    bits
        Shape (H, W).
    kernel
        Side of the kernel in pixels, odd.
    rounds
        How often.
    inside
        The region, shape (H, W); no other pixel is set. By default the whole image.

    Examples
    --------
    >>> ring = [[0, 0, 0, 0, 0], [0, 1, 1, 1, 0], [0, 1, 0, 1, 0], [0, 1, 1, 1, 0], [0, 0, 0, 0, 0]]
    >>> majority(np.array(ring, dtype=bool), 3, 1).astype(int).tolist()
    [[0, 0, 0, 0, 0], [0, 0, 1, 0, 0], [0, 1, 1, 1, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 0]]
    """
    cv2 = opencv("the cloth map")
    region = np.ones(bits.shape, dtype=np.bool_) if inside is None else inside
    kept = bits & region
    if kernel == 1 or rounds == 0:
        return kept

    def counted(image: BoolImage) -> FloatImage:
        count = cv2.boxFilter(
            image.astype(np.float32), -1, (kernel, kernel), normalize=False, borderType=cv2.BORDER_CONSTANT
        )
        return np.asarray(count, dtype=np.float32)

    half = counted(region) / 2
    for _ in range(rounds):
        kept = (counted(kept) > half) & region
    return kept


def without_lines(cloth: BoolImage, thinnest: int) -> BoolImage:
    """Cloth without what is nowhere so wide, unless it lies as near to cloth that is.

    A strap loses at most its end; a table's joints and the grout of its tiles go, also where they run under a garment.

    Parameters
    ----------
    cloth
        Shape (H, W).
    thinnest
        Diameter in pixels of the disc that must fit in somewhere, odd; 1 for none.

    Examples
    --------
    >>> cloth = np.zeros((9, 40), dtype=bool)
    >>> cloth[4], cloth[1:8, :9] = True, True
    >>> np.flatnonzero(without_lines(cloth, 5)[4]).max().item()
    10
    """
    if thinnest == 1:
        return cloth
    cv2 = opencv("the cloth map")
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (thinnest, thinnest))
    # What reaches beyond the image is not known to go on there: zeros all around.
    framed = cv2.copyMakeBorder(cloth.astype(np.uint8), *[thinnest] * 4, cv2.BORDER_CONSTANT, value=0)
    wide = cv2.dilate(cv2.morphologyEx(framed, cv2.MORPH_OPEN, disc), disc)
    return np.asarray(cloth & (wide[thinnest:-thinnest, thinnest:-thinnest] > 0))


def cloth_by_mask(pixelwise: ClothMap, masks: tuple[Mask, ...], settings: ClothSettings) -> ClothMap:
    """The map in which each mask is cloth or surface as a whole.

    A mask is surface if it is large (more than `surface_share` of the region, or touching `surface_sides` of its four
    sides) and the median of its colour distances is below the threshold. Pixels of any other mask are cloth; those of no
    mask are what their colour says; the rest is surface.

    Parameters
    ----------
    pixelwise
        The decision by pixel.
    masks
        What a segmenter found in the whole region.
    settings
        Thresholds.
    """
    ground, garments = (np.zeros(pixelwise.cloth.shape, dtype=np.bool_) for _ in range(2))
    for mask in masks:
        (ground if _is_surface(mask, pixelwise, settings) else garments)[mask.window] |= mask.bits
    return pixelwise.with_cloth(garments | (pixelwise.cloth & ~ground))


def _is_surface(mask: Mask, pixelwise: ClothMap, settings: ClothSettings) -> bool:
    inside = mask.bits & pixelwise.inside[mask.window]
    area = np.count_nonzero(inside)
    if area == 0:
        return True
    large = area > settings.surface_share * np.count_nonzero(pixelwise.inside)
    if not large and _sides(mask, inside, pixelwise.inside) < settings.surface_sides:
        return False
    return bool(np.median(pixelwise.distance[mask.window][inside]) < pixelwise.threshold)


def _sides(mask: Mask, bits: BoolImage, inside: BoolImage) -> int:
    """How many sides of the region's box the mask comes near to (2 pixels)."""
    region_rows, region_columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    rows, columns = np.flatnonzero(bits.any(axis=1)) + mask.top, np.flatnonzero(bits.any(axis=0)) + mask.left
    gaps = (
        rows[0] - region_rows[0],
        region_rows[-1] - rows[-1],
        columns[0] - region_columns[0],
        region_columns[-1] - columns[-1],
    )
    return sum(int(gap) <= 2 for gap in gaps)


def _frozen(bits: BoolImage) -> BoolImage:
    bits = np.array(bits, dtype=np.bool_)
    bits.setflags(write=False)
    return bits

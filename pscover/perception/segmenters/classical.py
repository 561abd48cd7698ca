"""Garments by colour: compact watershed regions, merged where neither colour nor boundary tells them apart.

No weights and no training; `bench/bench_perception.py` says what it costs. Steps:

1.  two bilateral filters even out folds and knitting without moving edges;
2.  features [10 ln(Y + 2), 75 a/(L + 25), 75 b/(L + 25)] of Lab and luminance Y in percent: chroma over lightness hardly
    moves when a fold darkens a cloth, and shading moves the logarithm alike on white and on grey, which leaves room between
    grey and black;
3.  a compact watershed of the features' gradient from a grid of markers cuts the cloth into regions of like size that
    follow edges;
4.  neighbouring regions are merged, the most alike first (`pscover.perception.merging`);
5.  what lies near a boundary is flooded again from both sides, so that the boundary settles on the edge.

Steps 2 to 5 are `pscover.perception.shades`.

What it cannot do: tell apart garments of one colour that touch (two light-blue shirts are one segment), keep a garment with
large prints or wide stripes whole (they become segments), join the parts of a garment that another one divides, or see
a garment of the surface's colour. SAM does most of these better and costs more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings, MissingDependency
from pscover.perception.colour import Photo, lab, opencv
from pscover.perception.mask import Mask
from pscover.perception.merging import merge
from pscover.perception.regions import pieces
from pscover.perception.segmenter import Segmentation
from pscover.perception.shades import (
    COMPACTNESS,
    LIGHTNESS,
    LIMIT,
    SMALL,
    SPACING,
    compact_regions,
    settled,
    shade_tolerant,
    steps,
)
from pscover.perception.stopwatch import Stopwatch

BoolImage = NDArray[np.bool_]
LabelImage = NDArray[np.int32]
DARKEST = 0.2
"""A photo whose brightest pixels are darker than this share of white is taken for one that has it: the rest is noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Classical:
    """Watershed regions merged by shade-tolerant colour; no weights. Touching garments of one colour become one segment.

    Parameters
    ----------
    limit
        How different two regions may be and still be merged, in units of the features (about a Lab distance at L = 50).
    small
        Regions of fewer pixels are merged more readily.
    spacing
        Distance of the markers in pixels: the size of the regions that are merged.
    compactness
        How much the regions prefer round shapes to edges.
    lightness
        Weight of the logarithm of luminance among the features.

    Raises
    ------
    InvalidSettings
        If a setting is outside its domain.
    """

    limit: float = LIMIT
    small: float = SMALL
    spacing: int = SPACING
    compactness: float = COMPACTNESS
    lightness: float = LIGHTNESS

    name: ClassVar[str] = "classical"
    requires: ClassVar[tuple[str, ...]] = ("cv2", "skimage")
    extra: ClassVar[str] = "perception"

    def __post_init__(self) -> None:
        if not 2 <= self.spacing <= 1000:
            raise InvalidSettings(f"spacing: expected a whole number of pixels from 2 to 1000, got {self.spacing!r}")
        for name in ("limit", "small", "compactness", "lightness"):
            value = getattr(self, name)
            if not 0 <= value <= 1e6:
                raise InvalidSettings(f"{name}: expected a number from 0 to a million, got {value!r}")

    def segment(self, photo: Photo, cloth: BoolImage) -> Segmentation:
        """Masks of the garments: disjoint, connected, and together the cloth.

        Parameters
        ----------
        photo
            RGB, shape (H, W, 3).
        cloth
            Which pixels show cloth rather than surface, shape (H, W).

        Raises
        ------
        MissingDependency
            Without OpenCV or scikit-image.
        """
        try:
            import skimage.segmentation  # noqa: F401
        except ImportError:
            raise MissingDependency.for_extra("segmenter 'classical'", ["scikit-image"], self.extra) from None
        if not cloth.any():
            return Segmentation(masks=())
        watch = Stopwatch()
        with watch.stage("features"):
            features = shade_tolerant(lab(evened(photo)), self.lightness)
        with watch.stage("regions"):
            regions = compact_regions(features, cloth, self.spacing, self.compactness)
        with watch.stage("merging"):
            merged = merge(regions, features, steps(features), self.limit, self.small)
        with watch.stage("boundaries"):
            masks = _masks(pieces(settled(merged, features)))
        return Segmentation(masks=masks, stages=watch.stages)


def evened(photo: Photo) -> Photo:
    """The photo with folds and knitting evened out and edges kept; in a dark photo, edges are lower in proportion."""
    cv2 = opencv("segmenter 'classical'")
    brightest = float(np.clip(np.quantile(photo[::4, ::4].max(axis=2), 0.99) / 255, DARKEST, 1))
    once = cv2.bilateralFilter(photo, 9, 40 * brightest, 7)
    return np.asarray(cv2.bilateralFilter(once, 9, 30 * brightest, 7), dtype=np.uint8)


def _masks(labels: LabelImage) -> tuple[Mask, ...]:
    from scipy.ndimage import find_objects

    found = []
    for number, window in enumerate(find_objects(labels), start=1):
        bits = labels[window] == number
        bits.setflags(write=False)
        found.append(Mask(top=window[0].start, left=window[1].start, bits=bits))
    return tuple(found)


segmenter = Classical

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
from pscover.perception.colour import FloatImage, Photo, lab, opencv
from pscover.perception.mask import Mask
from pscover.perception.merging import merge
from pscover.perception.regions import pieces
from pscover.perception.segmenter import Segmentation
from pscover.perception.stopwatch import Stopwatch

BoolImage = NDArray[np.bool_]
LabelImage = NDArray[np.int32]
BAND = 4
"""How far boundaries may move to the nearest edge, in pixels."""
STEP_SIGMA = 2.0
"""Scale in pixels at which steps between regions are measured."""


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

    limit: float = 12.0
    small: float = 2000.0
    spacing: int = 14
    compactness: float = 0.02
    lightness: float = 10.0

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
            features = shade_tolerant(evened(photo), self.lightness)
        with watch.stage("regions"):
            regions = self._regions(features, cloth)
        with watch.stage("merging"):
            # A blurred step of height h has the slope h / (sigma sqrt(2 pi)) in its middle.
            step = gradient(features, STEP_SIGMA) * np.float32(STEP_SIGMA * np.sqrt(2 * np.pi))
            merged = merge(regions, features, step, self.limit, self.small)
        with watch.stage("boundaries"):
            masks = _masks(pieces(settled(merged, features)))
        return Segmentation(masks=masks, stages=watch.stages)

    def _regions(self, features: FloatImage, cloth: BoolImage) -> LabelImage:
        """Compact regions; every piece of cloth has at least one."""
        from skimage.segmentation import watershed

        markers = np.zeros(cloth.shape, dtype=np.int32)
        at = slice(self.spacing // 2, None, self.spacing)
        grid = markers[at, at]
        grid[...] = np.arange(1, grid.size + 1).reshape(grid.shape)
        markers[~cloth] = 0
        islands = pieces(cloth.astype(np.int32))
        without = np.setdiff1d(np.arange(1, islands.max() + 1), islands[markers > 0])
        if len(without):
            first = np.unique(islands.ravel(), return_index=True)
            place = dict(zip(first[0].tolist(), first[1].tolist(), strict=True))
            for number, island in enumerate(without.tolist(), start=grid.size + 1):
                markers.ravel()[place[island]] = number
        cut = watershed(gradient(features, 1.2), markers, mask=cloth, compactness=self.compactness)
        return np.asarray(cut, dtype=np.int32)


def evened(photo: Photo) -> Photo:
    """The photo with folds and knitting evened out and edges kept."""
    cv2 = opencv("segmenter 'classical'")
    once = cv2.bilateralFilter(photo, 9, 40, 7)
    return np.asarray(cv2.bilateralFilter(once, 9, 30, 7), dtype=np.uint8)


def shade_tolerant(photo: Photo, lightness: float = 10.0) -> FloatImage:
    """Features that change little under shading: weighted log of luminance, and a and b over lightness, shape (H, W, 3)."""
    features = lab(photo)
    height = features[:, :, 0].copy()
    features *= np.float32(75) / (features[:, :, :1] + np.float32(25))
    luminance = np.where(height > 8, ((height + 16) / 116) ** 3, height / np.float32(903.3)) * 100
    features[:, :, 0] = np.float32(lightness) * np.log(luminance + np.float32(2))
    return features


def gradient(features: FloatImage, sigma: float) -> FloatImage:
    """Length of the features' gradient at a scale of sigma pixels, shape (H, W)."""
    cv2 = opencv("segmenter 'classical'")
    blurred = cv2.GaussianBlur(features, (0, 0), sigma)
    square = np.zeros(features.shape[:2], dtype=np.float32)
    for dx, dy in ((1, 0), (0, 1)):
        # Central differences: (f(x + 1) - f(x - 1)) / 2.
        slope = cv2.Sobel(blurred, cv2.CV_32F, dx, dy, ksize=1, scale=0.5)
        square += np.einsum("ijk,ijk->ij", slope, slope)
    return np.sqrt(square)


def settled(labels: LabelImage, features: FloatImage) -> LabelImage:
    """Labels whose boundaries have moved by up to `BAND` pixels to the nearest edge; none disappears, 0 stays 0."""
    from skimage.segmentation import watershed

    cv2 = opencv("segmenter 'classical'")
    kernel = np.ones((2 * BAND + 1, 2 * BAND + 1), dtype=np.uint8)
    image = labels.astype(np.float32)
    # Surface must not count as another label: garments are settled against each other only.
    lowest = -cv2.dilate(np.where(labels > 0, -image, -np.inf).astype(np.float32), kernel)
    near = cv2.dilate(image, kernel) != lowest
    markers = np.where(near, 0, labels)
    gone = np.setdiff1d(labels, markers)
    markers = np.where(np.isin(labels, gone), labels, markers)
    return np.asarray(watershed(gradient(features, 1.0), markers, mask=labels > 0), dtype=np.int32)


def _masks(labels: LabelImage) -> tuple[Mask, ...]:
    from scipy.ndimage import find_objects

    found = []
    for number, window in enumerate(find_objects(labels), start=1):
        bits = labels[window] == number
        bits.setflags(write=False)
        found.append(Mask(top=window[0].start, left=window[1].start, bits=bits))
    return tuple(found)


segmenter = Classical

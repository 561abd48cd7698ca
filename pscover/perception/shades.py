"""Regions of like colour whatever the shading: compact watershed regions of shade-tolerant features, merged.

The steps of the segmenter "classical" after its bilateral filters; `by_colour` is all of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pscover.perception.colour import FloatImage, opencv
from pscover.perception.merging import merge
from pscover.perception.regions import pieces

BoolImage = NDArray[np.bool_]
LabelImage = NDArray[np.int32]
LIMIT, SMALL = 11.0, 2000.0
"""How different two regions may be and still be merged, in units of the features, and the size from which that holds."""
SPACING, COMPACTNESS = 14, 0.02
"""Distance of the markers in pixels, and how much regions prefer round shapes to edges."""
LIGHTNESS = 10.0
"""Weight of the logarithm of luminance among the features."""
BRIGHTEST = 2.0
"""A dark photo is brightened by at most the cube of this."""
BAND = 4
"""How far boundaries may move to the nearest edge, in pixels."""
STEP_SIGMA = 2.0
"""Scale in pixels at which steps between regions are measured."""


def by_colour(image: FloatImage, where: BoolImage) -> LabelImage:
    """Connected regions of like colour that fill a part of an image.

    Parameters
    ----------
    image
        Lab, shape (H, W, 3).
    where
        The part, shape (H, W).

    Returns
    -------
    numpy.ndarray
        Numbered from 1, 0 outside the part, shape (H, W).

    Examples
    --------
    >>> image = np.full((40, 60, 3), 50, dtype=np.float32)
    >>> image[:, 30:, 1] = -50
    >>> found = by_colour(image, np.ones((40, 60), dtype=bool))
    >>> int(found.max()), bool(found[20, 10] != found[20, 50])
    (2, True)
    """
    features = shade_tolerant(image)
    regions = compact_regions(features, where)
    return pieces(settled(merge(regions, features, steps(features), LIMIT, SMALL), features))


def compact_regions(
    features: FloatImage, where: BoolImage, spacing: int = SPACING, compactness: float = COMPACTNESS
) -> LabelImage:
    """Regions of like size that follow edges; every connected part has at least one, shape (H, W)."""
    from skimage.segmentation import watershed

    markers = np.zeros(where.shape, dtype=np.int32)
    at = slice(spacing // 2, None, spacing)
    grid = markers[at, at]
    grid[...] = np.arange(1, grid.size + 1).reshape(grid.shape)
    markers[~where] = 0
    islands = pieces(where.astype(np.int32))
    without = np.setdiff1d(np.arange(1, islands.max() + 1), islands[markers > 0])
    if len(without):
        first = np.unique(islands.ravel(), return_index=True)
        place = dict(zip(first[0].tolist(), first[1].tolist(), strict=True))
        for number, island in enumerate(without.tolist(), start=grid.size + 1):
            markers.ravel()[place[island]] = number
    cut = watershed(gradient(features, 1.2), markers, mask=where, compactness=compactness)
    return np.asarray(cut, dtype=np.int32)


def steps(features: FloatImage) -> FloatImage:
    """Height of the step of the features at each pixel, shape (H, W)."""
    # A blurred step of height h has the slope h / (sigma sqrt(2 pi)) in its middle.
    return gradient(features, STEP_SIGMA) * np.float32(STEP_SIGMA * np.sqrt(2 * np.pi))


def shade_tolerant(image: FloatImage, lightness: float = LIGHTNESS) -> FloatImage:
    """Features of a Lab image that change little under shading: weighted log of luminance, and a and b over lightness.

    A photo in which nothing is white is brightened first, so that its brightest hundredth is: dark photos have the
    features of bright ones.
    """
    # Twice the light multiplies L + 16, a and b by the cube root of 2 (above L = 8).
    brightest = float(np.quantile(image[::4, ::4, 0], 0.99)) if image.size else 100.0
    brighter = np.float32(np.clip(116 / (max(brightest, 0.0) + 16), 1, BRIGHTEST))
    features = image * brighter
    features[:, :, 0] += 16 * (brighter - 1)
    height = features[:, :, 0].copy()
    features *= np.float32(75) / (features[:, :, :1] + np.float32(25))
    luminance = np.where(height > 8, ((height + 16) / 116) ** 3, height / np.float32(903.3)) * 100
    features[:, :, 0] = np.float32(lightness) * np.log(luminance + np.float32(2))
    return features


def gradient(features: FloatImage, sigma: float) -> FloatImage:
    """Length of the features' gradient at a scale of sigma pixels, shape (H, W)."""
    cv2 = opencv("perception")
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

    cv2 = opencv("perception")
    kernel = np.ones((2 * BAND + 1, 2 * BAND + 1), dtype=np.uint8)
    image = labels.astype(np.float32)
    # Surface must not count as another label: garments are settled against each other only.
    lowest = -cv2.dilate(np.where(labels > 0, -image, -np.inf).astype(np.float32), kernel)
    near = cv2.dilate(image, kernel) != lowest
    markers = np.where(near, 0, labels)
    gone = np.setdiff1d(labels, markers)
    markers = np.where(np.isin(labels, gone), labels, markers)
    return np.asarray(watershed(gradient(features, 1.0), markers, mask=labels > 0), dtype=np.int32)

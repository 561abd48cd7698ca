"""A label scene as a camera might see it: coloured cloth with folds, on a table in uneven light."""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, find_objects, gaussian_filter

from pscover.errors import InvalidSettings
from pscover.scene import Scene

FloatImage = NDArray[np.float64]
TABLE = (0.76, 0.74, 0.70)
"""Colour of the surface."""
ROUND = 5.0
"""Within so many pixels of its edge a garment bends down."""
FOLDS = 5.0
"""Scale of the folds in pixels."""
NOISE = 0.012
"""Standard deviation of the sensor's noise; white is 1."""


def paint(scene: Scene, seed: int = 0) -> NDArray[np.uint8]:
    """A photo of a scene, so that perception can be tried on garments whose outlines are known.

    Every garment has a colour of its own, folds that its light and shade show, and an edge that bends down; the surface is
    lit from one corner. Colours are drawn from the whole circle, at saturations and values that occur in clothes.

    Parameters
    ----------
    scene
        What lies where; the photo has its size.
    seed
        Of colours, folds and noise.

    Returns
    -------
    NDArray[np.uint8]
        RGB, shape (H, W, 3).

    Raises
    ------
    InvalidSettings
        If the seed is negative.

    Examples
    --------
    >>> from pscover.generate.garments import garments
    >>> photo = paint(garments(5, seed=0))
    >>> photo.shape, str(photo.dtype)
    ((282, 470, 3), 'uint8')
    """
    if seed < 0:
        raise InvalidSettings(f"seed: expected a whole number of at least 0, got {seed}")
    random = np.random.default_rng(seed)
    height, width = scene.shape
    colours = np.array([TABLE, *(_colour(random) for _ in range(scene.garments))])
    flat = colours[scene.segments + 1]
    light = 1 + 0.08 * (np.arange(width)[None] / width - 0.5) + 0.06 * (np.arange(height)[:, None] / height - 0.5)
    lit = flat * (light * _shade(scene, random))[..., None] + random.normal(0, NOISE, (height, width, 3))
    return np.clip(np.rint(255 * lit), 0, 255).astype(np.uint8)


def _colour(random: np.random.Generator) -> tuple[float, float, float]:
    hue, saturation, value = random.uniform(), random.uniform(0.35, 0.85), random.uniform(0.25, 0.85)
    return colorsys.hsv_to_rgb(hue, saturation, value)


def _shade(scene: Scene, random: np.random.Generator) -> FloatImage:
    """How bright each pixel is for its colour: the table about 1, garments by fold and by edge."""
    folds = gaussian_filter(random.standard_normal(scene.shape), FOLDS)
    folds *= 0.09 / max(float(folds.std()), 1e-9)
    grain = 0.01 * random.standard_normal(scene.shape)
    shade = np.where(scene.segments >= 0, 1 + folds, 1 + grain)
    edge = np.clip(_inside(scene) / ROUND, 0, 1)
    return np.asarray(np.where(scene.segments >= 0, shade * (0.8 + 0.2 * np.sqrt(edge)), shade))


def _inside(scene: Scene) -> FloatImage:
    """How many pixels each pixel of a garment is from its edge; 0 on the table."""
    distance = np.zeros(scene.shape)
    for j, (rows, columns) in enumerate(find_objects(scene.segments + 1, max_label=scene.garments)):
        # A garment's nearest pixel that is not its own lies in its box or right beside it.
        box = tuple(slice(max(0, span.start - 1), span.stop + 1) for span in (rows, columns))
        distance[box] += distance_transform_edt(scene.segments[box] == j)
    return distance

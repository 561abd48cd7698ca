"""The colour of the empty surface at each pixel, and how far the photo is from it.

The surface has one or a few colours (a tablecloth, a floor with tape on it). Each of them varies smoothly over the
picture (lamps, vignetting, glare), as a quadratic function of x and y, fitted by trimmed least squares to the pixels that
look like it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.perception.background import Background, Colour, EmptyTable, check_size
from pscover.perception.colour import FloatImage, is_grey, lab, smooth_lab
from pscover.perception.grid import Grid
from pscover.perception.modes import SPREAD, border_colours

BoolImage = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
SAMPLES = 20_000
"""About so many pixels enter a fit."""
SEEN, SAID = 12.0, 22.0
"""The distance within which pixels enter a fit at first: to a colour seen in the photo, and to one that the user gave."""
LAST, SHRINK, ROUNDS = 8.0, 0.75, 12
"""The distance at last, its factor from round to round, and the rounds."""
RIDGE = 5e-3, 0.3, 0.3
"""Holds the fits of L, a and b back from following garments: lamps change a surface's lightness more than its hue."""
ROUGHNESS = 1e-9, 1.0, 1.0, 2.0, 2.0, 2.0
"""How much of it each term of the quadratic gets."""
FEWEST = 30
"""Pixels below which nothing is fitted."""
COLOURS = 4
"""The most colours that "auto" gives a surface."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """The empty surface on a grid.

    Parameters
    ----------
    weights
        Of L, a and b in a colour distance, shape (3,).
    colours
        For each colour of the surface and each of L, a and b: the coefficients of 1, x, y, xy, x^2 and y^2, where x and y
        run from -1 to 1 over the grid, shape (colours, 6, 3).
    empty
        Smoothed Lab of the empty table to which the one colour is an offset, shape (H, W, 3), or None.
    """

    weights: NDArray[np.float32]
    colours: FloatArray
    empty: FloatImage | None = None

    @property
    def lightness(self) -> float:
        """L in the middle of the picture, of the lightest colour."""
        below = 0.0 if self.empty is None else float(np.median(self.empty[:, :, 0]))
        return float(self.colours[:, 0, 0].max()) + below

    def distance(self, image: FloatImage) -> FloatImage:
        """Colour distance of each pixel of a Lab image to the nearest colour of the surface, shape (H, W)."""
        height, width = image.shape[:2]
        nearest = np.full((height, width), np.inf, dtype=np.float32)
        for coefficients in self.colours:
            square = np.zeros((height, width), dtype=np.float32)
            for channel in range(3):
                rest = image[:, :, channel] - _quadratic(coefficients[:, channel], height, width)
                if self.empty is not None:
                    rest -= self.empty[:, :, channel]
                rest *= self.weights[channel]
                square += rest * rest
            np.minimum(nearest, square, out=nearest)
        return np.sqrt(nearest)


def fit_surface(
    image: FloatImage, inside: BoolImage, background: Background, grid: Grid, *, lightness: float = 0.5, median: int = 5
) -> Surface:
    """The surface that a photo shows between its garments.

    Parameters
    ----------
    image
        Lab of the photo on the grid, smoothed, shape (H, W, 3).
    inside
        The region of interest, shape (H, W).
    background
        What is known of the surface.
    grid
        How an empty table's photo comes to the size of `image`.
    lightness
        Weight of L in a colour distance: shadows are darker, not of another colour. It is 1 for a photo without colours.
    median
        Side of the median filter, for the photo of an empty table.

    Raises
    ------
    InvalidImage
        If the photo of the empty table has another size than the photo.
    """
    weights = np.array([1.0 if is_grey(image) else lightness, 1.0, 1.0], dtype=np.float32)
    sample = _Sample.of(image, inside, weights)
    if isinstance(background, EmptyTable):
        check_size(background, grid.photo_shape)
        empty = smooth_lab(grid.scaled(background.photo), median)
        offset = sample.less(empty).fit(np.zeros(3), SAID)
        return Surface(weights=weights, colours=offset[None], empty=empty)
    if isinstance(background, Colour):
        one = np.array([[[background.red, background.green, background.blue]]], dtype=np.uint8)
        return Surface(weights=weights, colours=sample.fit(lab(one)[0, 0].astype(float), SAID)[None])
    return Surface(weights=weights, colours=_automatic(image, inside, weights, sample))


def _automatic(image: FloatImage, inside: BoolImage, weights: NDArray[np.float32], sample: _Sample) -> FloatArray:
    """One fit for each colour that runs along most of the border and that those before do not explain."""
    found: list[FloatArray] = []
    explained = ~inside
    while len(found) < COLOURS:
        colour = border_colours(image, inside, explained, weights, spread=SPREAD if found else 0.0)
        if colour is None:
            break
        found.append(sample.fit(colour, SEEN))
        explained |= Surface(weights=weights, colours=found[-1][None]).distance(image) < LAST
    return np.array(found)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Sample:
    """A subset of the pixels of the region: their terms (n, 6), Lab (n, 3), places (rows, columns), and the weights."""

    terms: FloatArray
    values: FloatArray
    places: tuple[NDArray[np.intp], NDArray[np.intp]]
    weights: FloatArray

    @classmethod
    def of(cls, image: FloatImage, inside: BoolImage, weights: NDArray[np.float32]) -> _Sample:
        height, width = inside.shape
        step = max(1, int(np.sqrt(np.count_nonzero(inside) / SAMPLES)))
        rows, columns = np.nonzero(inside[::step, ::step])
        if len(rows) < FEWEST:
            rows, columns, step = *np.nonzero(inside), 1
        rows, columns = rows * step, columns * step
        return cls(
            terms=_terms(_axis(width)[columns], _axis(height)[rows]),
            values=image[rows, columns].astype(float),
            places=(rows, columns),
            weights=weights.astype(float),
        )

    def less(self, image: FloatImage) -> _Sample:
        """The same pixels, their difference to another image."""
        return _Sample(terms=self.terms, values=self.values - image[self.places], places=self.places, weights=self.weights)

    def fit(self, start: FloatArray, reach: float) -> FloatArray:
        """Coefficients of a quadratic surface near a colour, shape (6, 3); the colour where too few pixels look like it."""
        coefficients = np.zeros((6, 3))
        coefficients[0] = start
        for _ in range(ROUNDS):
            near = np.linalg.norm((self.values - self.terms @ coefficients) * self.weights, axis=1) < reach
            if np.count_nonzero(near) < max(FEWEST, 0.002 * len(near)):
                return coefficients
            terms, values = self.terms[near], self.values[near] - start
            for channel, ridge in enumerate(RIDGE):
                stiff = np.diag(ROUGHNESS) * ridge * len(self.terms)
                coefficients[:, channel] = np.linalg.solve(terms.T @ terms + stiff, terms.T @ values[:, channel])
            coefficients[0] += start
            reach = max(LAST, reach * SHRINK)
        return coefficients


def _axis(size: int) -> FloatArray:
    """Pixel centres from -1 to 1."""
    return np.linspace(-1, 1, size) if size > 1 else np.zeros(1)


def _terms(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.stack([np.ones_like(x), x, y, x * y, x * x, y * y], axis=-1)


def _quadratic(coefficients: FloatArray, height: int, width: int) -> FloatImage:
    one, x, y, xy, xx, yy = coefficients.astype(np.float32)
    u, v = _axis(width).astype(np.float32)[None], _axis(height).astype(np.float32)[:, None]
    image: FloatImage = (one + x * u + xx * u * u) + (y * v + yy * v * v) + (xy * v) * u
    return image

"""A predictor whose numbers were fitted to logged grasps; in centimetres, so that it fits any camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.errors import InvalidSettings
from pscover.files import read_bytes
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.features import FEATURES, features
from pscover.grasping.predictor import Predictor
from pscover.scene import Scene

BYTE_LIMIT = 2**20
FloatArray = NDArray[np.float64]
HIGHEST = 0.999
"""Probabilities are cut off here: none is certain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibrated:
    """The ellipse predictor with fitted numbers, p = a / (a + b), or its extension by more features of a grasp.

    In logits the ellipse predictor is log(a / b). The extension adds a constant and multiples of
    `pscover.grasping.features`.

    Parameters
    ----------
    major_cm, minor_cm
        d1 and d2.
    half_cm2
        b.
    weights
        Of the constant and of each feature; empty for the ellipse alone.
    means, scales
        With which the features were made comparable, one each.

    Raises
    ------
    InvalidSettings
        If a number is outside its domain.

    Examples
    --------
    >>> scene = Scene.of(np.ones((60, 60), dtype=int))
    >>> fitted = Calibrated(major_cm=10, minor_cm=2, half_cm2=5)
    >>> fitted.at(4.7).probability(scene, np.array([[30.0, 30, 0]])).toarray().round(2).tolist()
    [[0.76]]
    """

    major_cm: float
    minor_cm: float
    half_cm2: float
    weights: tuple[float, ...] = ()
    means: tuple[float, ...] = ()
    scales: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for name in ("major_cm", "minor_cm", "half_cm2"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InvalidSettings(f"{name}: expected a positive number, got {value!r}")
        size = len(FEATURES) if self.weights else 0
        for name, expected in (("weights", size + bool(size)), ("means", size), ("scales", size)):
            values = getattr(self, name)
            if len(values) != expected or not all(map(math.isfinite, values)):
                raise InvalidSettings(f"{name}: expected {expected} finite numbers, got {values!r}")
        if not all(scale > 0 for scale in self.scales):
            raise InvalidSettings(f"scales: expected positive numbers, got {self.scales!r}")

    def at(self, pixels_per_cm: float, heights: NDArray[np.floating] | None = None) -> Predictor:
        """The predictor in pixels of a scene of that scale.

        Parameters
        ----------
        pixels_per_cm
            Of the scene.
        heights
            Metres above the table, of the scene's shape; without them, a grasp counts as being of average height.
        """
        ellipse = Ellipse(
            major=self.major_cm * pixels_per_cm,
            minor=self.minor_cm * pixels_per_cm,
            half=self.half_cm2 * pixels_per_cm**2,
        )
        return Extended(ellipse=ellipse, fitted=self, heights=heights) if self.weights else ellipse


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Extended:
    """A fitted predictor with all its features, at a scene's scale.

    Parameters
    ----------
    ellipse
        In pixels.
    fitted
        Weights, means and scales.
    heights
        Metres above the table, or None.
    """

    ellipse: Ellipse
    fitted: Calibrated
    heights: NDArray[np.floating] | None

    @property
    def axes(self) -> tuple[float, float]:
        """The gripper's footprint."""
        return self.ellipse.axes

    def probability(self, scene: Scene, poses: FloatArray) -> csc_array:
        """p_ij, shape (garments, grasps); 0 where no pixel of the garment is under the ellipse."""
        poses = np.asarray(poses, dtype=np.float64).reshape(-1, 3)
        areas = self.ellipse.areas(scene, poses)
        grasp = np.repeat(np.arange(len(poses)), np.diff(areas.indptr))
        columns = features(scene, poses, areas, self.heights)
        logits = np.log(areas.data / self.ellipse.half) + adjustment(self.fitted, columns)
        return csc_array((squashed(logits), (areas.indices, grasp)), shape=areas.shape)


def adjustment(fitted: Calibrated, columns: FloatArray) -> FloatArray:
    """What the features add to the logits, shape (pairs,); features that are not known (NaN) add nothing."""
    if not fitted.weights:
        return np.zeros(len(columns))
    standard = (columns - np.array(fitted.means)) / np.array(fitted.scales)
    added: FloatArray = fitted.weights[0] + np.nan_to_num(standard, nan=0.0) @ np.array(fitted.weights[1:])
    return added


def squashed(logits: FloatArray) -> FloatArray:
    """Probabilities of logits, below 1 and above 0.

    Examples
    --------
    >>> squashed(np.array([-1000.0, 0.0, 1000.0])).round(3).tolist()
    [0.0, 0.5, 0.999]
    """
    inner = np.clip(logits, -30.0, 30.0)
    chance: FloatArray = np.minimum(HIGHEST, 1.0 / (1.0 + np.exp(-inner)))
    return chance


def read_predictor(path: str | PathLike[str]) -> Calibrated:
    """A predictor from its JSON file, as `pscover calibrate` writes it.

    Raises
    ------
    InvalidSettings
        If the file is missing, damaged or of another kind.
    """
    import msgspec

    try:
        return msgspec.json.decode(read_bytes(Path(path), BYTE_LIMIT, InvalidSettings), type=Calibrated)
    except msgspec.DecodeError as problem:
        raise InvalidSettings(
            f"{path}: expected a predictor of `pscover calibrate`, got something else ({problem})"
        ) from None

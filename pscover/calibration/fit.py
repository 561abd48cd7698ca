"""Maximum-likelihood fits of the predictor's numbers to logged grasps, and how well they foretell others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pscover.calibration.logged import Logged
from pscover.errors import InvalidResult
from pscover.grasping.calibrated import Calibrated, adjustment
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.features import FEATURES, features

FloatArray = NDArray[np.float64]
PAPER = Calibrated(major_cm=40 / 4.7, minor_cm=12 / 4.7, half_cm2=100 / 4.7**2)
"""The paper's numbers."""
REACH_CM = 8.0
"""Garments farther from a grasp than this do not count in a fit: that they stay tells nothing."""
FINE = 2.35
"""Pixels a centimetre of which the size of the ellipse is fitted: half the paper's."""
FLOOR = 0.005
"""Probabilities are kept so far from 0 and 1 where their logarithm is taken."""
RIDGE = 1.0
"""Pulls the weights of standardised features and the constant towards 0, as so many made-up observations would. Without it,
nothing bounds the constant where all garments under the gripper were removed."""
PULL = (25.0, 25.0, 1.0)
"""The same for the logarithms of d1, d2 and b, towards the numbers that a fit starts from: few grasps are told apart by
absurd numbers, too. The jaw can be measured, to a fifth or so; b cannot."""
FEWEST = 20
"""Pairs of a grasp and a garment below which nothing is fitted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pairs:
    """Every grasp with every garment near it.

    Parameters
    ----------
    probability
        That the grasp removes the garment, shape (pairs,).
    removed
        Whether it did, shape (pairs,).
    """

    probability: FloatArray
    removed: NDArray[np.bool_]

    @property
    def log_loss(self) -> float:
        """Mean of -log of the probability of what happened: the lower the better."""
        p = np.clip(self.probability, FLOOR, 1 - FLOOR)
        return float(-np.where(self.removed, np.log(p), np.log1p(-p)).mean())

    @property
    def brier(self) -> float:
        """Mean squared difference between the probability and what happened."""
        return float(((self.probability - self.removed) ** 2).mean())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Near:
    """The pixels near grasps, in the gripper's own coordinates: squared cm along and across the jaw, shape (pixels,).

    Parameters
    ----------
    along, across
        Squared, of each pixel.
    cm2
        That each pixel stands for.
    pair
        The pair of a grasp and a garment that each belongs to.
    removed
        Whether each pair's garment was, shape (pairs,).
    """

    along: FloatArray
    across: FloatArray
    cm2: FloatArray
    pair: NDArray[np.intp]
    removed: NDArray[np.bool_]

    def areas(self, major: float, minor: float) -> FloatArray:
        """How much of each garment lies under its grasp's ellipse, in cm2, shape (pairs,)."""
        inside = self.along * (2 / major) ** 2 + self.across * (2 / minor) ** 2 <= 1
        counted = np.bincount(self.pair[inside], weights=self.cm2[inside], minlength=len(self.removed))
        return counted.astype(np.float64)


def pairs(grasps: Sequence[Logged], predictor: Calibrated) -> Pairs:
    """What a predictor foretells of logged grasps, and what happened.

    Raises
    ------
    InvalidResult
        If there are too few.
    """
    probability, removed = [], []
    for grasp in grasps:
        scene = grasp.scene
        foretold = predictor.at(scene.pixels_per_cm, grasp.heights).probability(scene, grasp.pose[None]).toarray()[:, 0]
        near = np.unique(_reached(grasp)[2])
        probability.extend(foretold[near].tolist())
        removed.extend(grasp.removed[near].tolist())
    _check(len(removed))
    return Pairs(probability=np.array(probability), removed=np.array(removed))


def fit_ellipse(grasps: Sequence[Logged], start: Calibrated = PAPER) -> Calibrated:
    """b, d1 and d2 of greatest likelihood, but for a pull towards `start` that gives way as grasps become many (`PULL`).

    The likelihood changes in small steps with d1 and d2, as pixels come under the ellipse, so it is climbed without
    slopes (Nelder and Mead 1965), in logarithms, from the paper's numbers.

    Raises
    ------
    InvalidResult
        If there are too few grasps.
    """
    from scipy.optimize import minimize

    near = _near(grasps)
    first = np.log([start.major_cm, start.minor_cm, start.half_cm2])

    def loss(logs: FloatArray) -> float:
        major, minor, half = np.exp(np.clip(logs, -7, 7))
        if max(major, minor) > 2 * REACH_CM:
            return 1e3
        areas = near.areas(major, minor)
        pull = 0.5 * float(np.square(logs - first) @ PULL) / len(near.removed)
        return Pairs(probability=areas / (areas + half), removed=near.removed).log_loss + pull

    options = {
        "maxiter": 300,
        "xatol": 1e-3,
        "fatol": 1e-6,
        "initial_simplex": first + 0.4 * np.vstack([np.zeros(3), np.eye(3)]),
    }
    found = minimize(loss, first, method="Nelder-Mead", options=options)
    best = found.x if loss(found.x) < loss(first) else first
    major, minor, half = (float(value) for value in np.exp(best))
    return Calibrated(major_cm=major, minor_cm=minor, half_cm2=half)


def fit_logistic(grasps: Sequence[Logged], ellipse: Calibrated) -> Calibrated:
    """Weights of the features on top of a fitted ellipse: regularised logistic regression.

    Raises
    ------
    InvalidResult
        If there are too few grasps.
    """
    from scipy.optimize import minimize

    columns, logits, removed = _table(grasps, ellipse)
    _check(len(removed))
    means, scales = _moments(columns)
    plain = replace(ellipse, weights=(0.0,) * (len(FEATURES) + 1), means=means, scales=scales)
    sign = np.where(removed, 1.0, -1.0)

    def loss(weights: FloatArray) -> float:
        total = logits + adjustment(replace(plain, weights=tuple(weights.tolist())), columns)
        return float(np.logaddexp(0.0, -sign * total).sum() + 0.5 * RIDGE * (weights**2).sum())

    found = minimize(loss, np.zeros(len(FEATURES) + 1), method="L-BFGS-B")
    return replace(plain, weights=tuple(float(weight) for weight in found.x))


def _table(grasps: Sequence[Logged], ellipse: Calibrated) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Features, logits of the ellipse, and outcomes of the garments under it."""
    columns, logits, removed = [np.zeros((0, len(FEATURES)))], [np.zeros(0)], [np.zeros(0, dtype=np.bool_)]
    for grasp in grasps:
        under = ellipse.at(grasp.scene.pixels_per_cm)
        assert isinstance(under, Ellipse)
        areas = under.areas(grasp.scene, grasp.pose[None])
        columns.append(features(grasp.scene, grasp.pose[None], areas, grasp.heights))
        logits.append(np.log(areas.data / under.half))
        removed.append(grasp.removed[areas.indices])
    return np.concatenate(columns), np.concatenate(logits), np.concatenate(removed)


def _moments(columns: FloatArray) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Means and spreads of what is known of each feature; 0 and 1 where nothing is."""
    means, scales = [], []
    for column in columns.T:
        known = column[np.isfinite(column)]
        spread = float(known.std()) if len(known) else 0.0
        means.append(float(known.mean()) if len(known) else 0.0)
        scales.append(spread if spread > 1e-9 else 1.0)
    return tuple(means), tuple(scales)


def _reached(grasp: Logged, step: int = 1) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.int32]]:
    """Rows, columns and garments of the pixels within reach, or of each so many-th along both axes."""
    scene, reach = grasp.scene, REACH_CM * grasp.scene.pixels_per_cm
    x, y, _ = grasp.pose
    rows, columns = (places * step for places in np.nonzero(scene.segments[::step, ::step] >= 0))
    close = (columns - x) ** 2 + (rows - y) ** 2 <= reach**2
    rows, columns = rows[close], columns[close]
    return rows, columns, scene.segments[rows, columns]


def _near(grasps: Sequence[Logged]) -> _Near:
    along: list[FloatArray] = []
    across: list[FloatArray] = []
    cm2: list[FloatArray] = []
    pair: list[NDArray[np.intp]] = []
    removed: list[NDArray[np.bool_]] = []
    count = 0
    for grasp in grasps:
        scale = grasp.scene.pixels_per_cm
        step = max(1, round(scale / FINE))
        rows, columns, garments = _reached(grasp, step)
        x, y, theta = grasp.pose
        dx, dy = (columns - x) / scale, (rows - y) / scale
        along.append((dx * math.cos(theta) + dy * math.sin(theta)) ** 2)
        across.append((dy * math.cos(theta) - dx * math.sin(theta)) ** 2)
        cm2.append(np.full(len(dx), (step / scale) ** 2))
        known, index = np.unique(garments, return_inverse=True)
        pair.append(index.ravel() + count)
        removed.append(grasp.removed[known])
        count += len(known)
    _check(count)
    return _Near(
        along=np.concatenate(along),
        across=np.concatenate(across),
        cm2=np.concatenate(cm2),
        pair=np.concatenate(pair),
        removed=np.concatenate(removed),
    )


def _check(count: int) -> None:
    if count < FEWEST:
        raise InvalidResult(
            f"records: expected at least {FEWEST} pairs of a grasp and a garment near it, got {count}; "
            "record more episodes of a policy that plans by segments"
        )

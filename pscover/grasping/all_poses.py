"""Every pose of the grid: each garment pixel at each orientation, and what a grasp there is worth to each garment.

The worth of a pose to garment j is its entry of the covering row, -log(1 - p_ij) / b_j with b_j = -log(1 - q_j) (paper,
Eq. 2), truncated at 1, which no plan notices. Poses of one part of the partition form one clique, as sampled grasps of one
part do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pscover.errors import Refused
from pscover.grasping.area_maps import area_maps
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.partition import Partition, partition
from pscover.grasping.predictor import Predictor
from pscover.grasping.sampling import Sampling
from pscover.instance import TOLERANCE
from pscover.scene import Scene

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Over = Callable[[], bool]
ENTRIES = 2**27
"""Most pairs of a pose and a garment within its reach: 1 GiB."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AllPoses:
    """The poses, part by part; within a part angle by angle, within an angle pixel by pixel.

    Parameters
    ----------
    pixels
        The garment pixels as flat indices into the image, part by part, shape (pixels,).
    first
        Where each part begins among them, and their number, shape (parts + 1,).
    angles
        Orientations in radians.
    width
        Of the image.
    garments
        For each part, those under the gripper in some of its poses; without those of which nothing is required.
    worth
        For each part, entries of the covering rows, shape (garments of the part, poses of the part), in [0, 1].
    total
        For each part, the sum over garments of what the entries are before truncation, shape (poses of the part,).
    needed
        The least that a plan brings to each garment's row, shape (garments,): 1, less what a goal forgives.
    """

    pixels: IntArray
    first: IntArray
    angles: FloatArray
    width: int
    garments: tuple[IntArray, ...]
    worth: tuple[FloatArray, ...]
    total: tuple[FloatArray, ...]
    needed: FloatArray

    def __len__(self) -> int:
        return len(self.pixels) * len(self.angles)

    @property
    def parts(self) -> int:
        """The number of parts."""
        return len(self.garments)

    @property
    def rows(self) -> int:
        """The number of covering rows, those included that nothing is required of."""
        return len(self.needed)

    def wanted(self) -> IntArray:
        """The rows to which some pose is worth something, rising."""
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *self.garments]))

    def starts(self) -> IntArray:
        """The number of each part's first pose, shape (parts + 1,)."""
        return self.first * len(self.angles)

    def part_of(self, numbers: IntArray) -> NDArray[np.int32]:
        """The parts of poses given by their numbers."""
        return (np.searchsorted(self.starts(), numbers, side="right") - 1).astype(np.int32)

    def poses(self, numbers: IntArray) -> FloatArray:
        """x and y in pixels and theta in radians, shape (numbers, 3)."""
        part = self.part_of(numbers)
        size = np.diff(self.first)[part]
        angle, inner = np.divmod(numbers - self.starts()[part], np.maximum(size, 1))
        y, x = np.divmod(self.pixels[self.first[part] + inner], self.width)
        return np.column_stack((x, y, self.angles[angle])).astype(np.float64)


def all_poses(
    scene: Scene, sampling: Sampling, predictor: Predictor, required: FloatArray, over: Over = lambda: False
) -> AllPoses | None:
    """Every pose of a scene, with its worth.

    Parameters
    ----------
    scene
        What lies on the surface.
    sampling
        Whose orientations and reach are taken; its points are not.
    predictor
        What a grasp will probably remove. The ellipse is evaluated at all poses at once (`pscover.grasping.area_maps`),
        another predictor pose by pose.
    required
        q_j in [0, 1), shape (garments,).
    over
        Asked garment by garment whether to give up.

    Returns
    -------
    AllPoses
        None if it was given up.

    Raises
    ------
    Refused
        If there are more pairs of a pose and a garment than memory is meant for.

    Examples
    --------
    >>> scene = Scene.of(np.ones((30, 40), dtype=int))
    >>> found = all_poses(scene, Sampling(), Ellipse(), np.array([0.7]))
    >>> len(found), found.parts, found.worth[0].shape
    (7200, 1, (1, 7200))
    """
    parts = partition(scene, sampling.reach)
    flat = parts.parts.ravel()
    pixels = np.flatnonzero(flat >= 0)
    pixels = pixels[np.argsort(flat[pixels], kind="stable")]
    first = np.concatenate(([0], np.cumsum(np.bincount(flat[pixels], minlength=len(parts)))))
    if over():
        return None
    angles = sampling.angles()
    blank = AllPoses(
        pixels=pixels,
        first=first,
        angles=angles,
        width=scene.shape[1],
        garments=tuple(_wanted(reached, required) for reached in _touched(scene, parts, sampling, predictor)),
        worth=(),
        total=(),
        needed=needed(required),
    )
    sizes = np.diff(blank.starts())
    entries = sum(len(garments) * int(size) for garments, size in zip(blank.garments, sizes, strict=True))
    if entries > ENTRIES:
        raise Refused(
            f"candidates 'all': expected at most {ENTRIES} pairs of a pose and a garment under it, got {entries}; look at "
            "the photo on a coarser grid, take fewer orientations, or use candidates 'sampled'"
        )
    filled = _by_maps(blank, scene, predictor, required, over) if type(predictor) is Ellipse else None
    return filled or (None if over() else _one_by_one(blank, scene, predictor, required, over))


def _wanted(garments: tuple[int, ...], required: FloatArray) -> IntArray:
    listed = np.array(garments, dtype=np.int64)
    wanted: IntArray = listed[required[listed] > 0]
    return wanted


def _touched(scene: Scene, parts: Partition, sampling: Sampling, predictor: Predictor) -> list[tuple[int, ...]]:
    """For each part, the garments that a gripper on one of its pixels may have under it, and perhaps more."""
    length = max(predictor.axes) / 2
    if type(predictor) is not Ellipse:
        return [tuple(range(scene.garments))] * len(parts)
    if sampling.reach >= length * (1 + 1e-9):
        return list(parts.reached)
    # The hair of slack on the ellipse's rim.
    finer = partition(scene, length * (1 + 1e-6))
    on = parts.parts >= 0
    found: list[set[int]] = [set() for _ in range(len(parts))]
    for part, fine in np.unique(np.stack((parts.parts[on], finer.parts[on])), axis=1).T.tolist():
        found[part].update(finer.reached[fine])
    return [tuple(sorted(garments)) for garments in found]


def _by_maps(blank: AllPoses, scene: Scene, ellipse: Ellipse, required: FloatArray, over: Over) -> AllPoses | None:
    """Fill in the worth garment by garment, from area maps."""
    count, sizes = len(blank.angles), np.diff(blank.first)
    depth = np.array([len(garments) for garments in blank.garments], dtype=np.int64)
    offset = np.concatenate(([0], np.cumsum(depth * sizes * count)))
    worth = np.zeros(offset[-1])
    total = np.zeros(len(blank))
    members: list[list[tuple[int, int]]] = [[] for _ in range(scene.garments)]
    for part, garments in enumerate(blank.garments):
        for row, garment in enumerate(garments.tolist()):
            members[garment].append((part, row))
    areas = np.arange(int(np.ceil(ellipse.major + 2) * np.ceil(ellipse.minor + 2)) + 1, dtype=np.float64)
    for found in area_maps(scene, ellipse, blank.angles):
        if over():
            return None
        if not members[found.garment]:
            continue
        part, row = np.array(members[found.garment], dtype=np.int64).T
        entries = entry(areas / (areas + ellipse.half), float(required[found.garment]))
        lengths = sizes[part]
        which = np.repeat(np.arange(len(part)), lengths)
        inner = np.arange(len(which)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        y, x = np.divmod(blank.pixels[blank.first[part][which] + inner], blank.width)
        into = (offset[part] + row * lengths * count)[which] + inner
        sums = (blank.first[part] * count)[which] + inner
        for angle in range(count):
            values = entries[found.at(angle, y, x)]
            shift = angle * lengths[which]
            worth[into + shift] = np.minimum(values, 1.0)
            total[sums + shift] += values
    blocks = [worth[offset[p] : offset[p + 1]].reshape(depth[p], sizes[p] * count) for p in range(blank.parts)]
    return _with(blank, blank.garments, blocks, total)


def _one_by_one(blank: AllPoses, scene: Scene, predictor: Predictor, required: FloatArray, over: Over) -> AllPoses | None:
    """Fill in the worth part by part, from the predictor itself."""
    starts = blank.starts()
    garments, blocks, total = [], [], np.zeros(len(blank))
    for part in range(blank.parts):
        if over():
            return None
        numbers = np.arange(starts[part], starts[part + 1])
        found = predictor.probability(scene, blank.poses(numbers)).tocsr()
        here = np.flatnonzero((np.diff(found.indptr) > 0) & (required > 0))
        rows = [entry(found[[j], :].toarray().ravel(), float(required[j])) for j in here]
        values = np.array(rows).reshape(len(here), len(numbers))
        garments.append(here)
        total[starts[part] : starts[part + 1]] = values.sum(axis=0)
        blocks.append(np.minimum(values, 1.0))
    return _with(blank, tuple(garments), blocks, total)


def entry(probability: FloatArray, required: float) -> FloatArray:
    """-log(1 - p) / -log(1 - q): which part of the requirement q a grasp of probability p meets (paper, Eq. 2).

    Examples
    --------
    >>> entry(np.array([0.0, 0.5, 0.75]), 0.75).tolist()
    [0.0, 0.5, 1.0]
    """
    with np.errstate(divide="ignore"):
        met: FloatArray = -np.log1p(-probability) / -np.log1p(-required)
    return met


def needed(required: FloatArray) -> FloatArray:
    """What every plan that a goal accepts brings to each covering row; 0 where nothing is required.

    Examples
    --------
    >>> least = needed(np.array([0.0, 0.7, 0.9999]))
    >>> float(least[0]), bool(1 - 1e-8 < least[1] < 1), bool(1 - 1e-5 < least[2] < 1 - 1e-6)
    (0.0, True, True)
    """
    # Twice, as coverage is weighed in floating point.
    accepted = np.log1p(-np.maximum(0.0, required - 2 * TOLERANCE))
    least: FloatArray = np.divide(accepted, np.log1p(-required), out=np.zeros(len(required)), where=required > 0)
    return least


def _with(blank: AllPoses, garments: tuple[IntArray, ...], blocks: list[FloatArray], total: FloatArray) -> AllPoses:
    starts = blank.starts().tolist()
    for array in (*blocks, total, blank.pixels, blank.first, blank.needed):
        array.setflags(write=False)
    return AllPoses(
        pixels=blank.pixels,
        first=blank.first,
        angles=blank.angles,
        width=blank.width,
        garments=garments,
        worth=tuple(blocks),
        total=tuple(total[a:b] for a, b in pairwise(starts)),
        needed=blank.needed,
    )

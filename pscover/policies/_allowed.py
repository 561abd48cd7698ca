"""A predictor for which grasps that must not be made remove nothing, so that they are never candidates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.grasping.predictor import Predictor
from pscover.scene import Scene

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Allowed:
    """Another predictor without the grasps near points of failure, and without those that would mix classes.

    Parameters
    ----------
    predictor
        The other one.
    failed
        Points (x, y) in pixels of the scene, shape (points, 2).
    radius
        Pixels around them that are left alone.
    groups
        A number for the class of each garment, shape (garments,); None if classes do not matter.
    mixing
        The highest probability that a grasp removes a garment of another class than the one it most probably removes. If no
        grasp mixes so little, those that mix least are allowed.
    """

    predictor: Predictor
    failed: FloatArray
    radius: float
    groups: NDArray[np.intp] | None = None
    mixing: float = 0.0

    @property
    def axes(self) -> tuple[float, float]:
        """The gripper's footprint."""
        return self.predictor.axes

    def probability(self, scene: Scene, poses: FloatArray) -> csc_array:
        """p_ij, shape (garments, grasps), 0 for grasps that must not be made.

        Examples
        --------
        >>> from pscover.grasping.ellipse import Ellipse
        >>> scene = Scene.of([[1] * 30 + [2] * 30] * 30)
        >>> poses = np.array([[15.0, 15, 1.57], [29.0, 15, 0.0], [45.0, 15, 1.57]])
        >>> allowed = Allowed(
        ...     predictor=Ellipse(), failed=np.array([[45.0, 20]]), radius=9, groups=np.array([0, 1])
        ... )
        >>> (allowed.probability(scene, poses).toarray() > 0).astype(int).tolist()
        [[1, 0, 0], [0, 0, 0]]
        """
        p = self.predictor.probability(scene, poses)
        kept = self._clear_of_failures(poses)
        if self.groups is not None:
            mixed = mixing_probability(p, self.groups)
            pure = kept & (mixed <= self.mixing)
            least = mixed[kept].min() if kept.any() else 0.0
            kept = pure if pure.any() else kept & (mixed <= least)
        owner = np.repeat(np.arange(p.shape[1]), np.diff(p.indptr))
        entries = kept[owner]
        rows, columns = p.indices[entries], owner[entries]
        return csc_array((p.data[entries], (rows, columns)), shape=p.shape)

    def _clear_of_failures(self, poses: FloatArray) -> NDArray[np.bool_]:
        kept = np.ones(len(poses), dtype=np.bool_)
        for x, y in self.failed:
            kept &= (poses[:, 0] - x) ** 2 + (poses[:, 1] - y) ** 2 > self.radius**2
        return kept


def mixing_probability(p: csc_array, groups: NDArray[np.intp]) -> FloatArray:
    """The probability that each grasp removes a garment of another class than its most probable one's, shape (grasps,).

    Examples
    --------
    >>> p = csc_array(np.array([[0.8, 0.8], [0.0, 0.5], [0.5, 0.0]]))
    >>> mixing_probability(p, np.array([0, 1, 0])).round(3).tolist()
    [0.0, 0.5]
    """
    mixed = np.zeros(p.shape[1])
    for i in np.flatnonzero(np.diff(p.indptr) > 1):
        span = slice(p.indptr[i], p.indptr[i + 1])
        chance, group = p.data[span], groups[p.indices[span]]
        others = group != group[int(chance.argmax())]
        mixed[i] = 1.0 - float(np.prod(1.0 - chance[others]))
    return mixed

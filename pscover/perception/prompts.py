"""Where to prompt next: the most interior points of cloth that nothing explains yet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt


def interior_points(unexplained: NDArray[np.bool_], count: int, reach: float, thinnest: float) -> NDArray[np.intp]:
    """Up to `count` cells, each farthest from the rim of what is left when the discs around the earlier ones are gone.

    Parameters
    ----------
    unexplained
        Shape (rows, columns).
    count
        At most so many.
    reach
        The largest radius, in cells, of the disc that a point takes away; a narrow place takes away its own width.
    thinnest
        Where the rim is nearer than this, in cells, nothing is prompted.

    Returns
    -------
    numpy.ndarray
        (row, column), shape (n, 2), widest places first.

    Examples
    --------
    >>> cloth = np.zeros((7, 12), dtype=bool)
    >>> cloth[1:6, 1:6] = cloth[2:5, 8:11] = True
    >>> interior_points(cloth, 5, 4.0, 1.5).tolist()
    [[3, 3], [3, 9]]
    """
    rows, columns = np.ogrid[: unexplained.shape[0] + 2, : unexplained.shape[1] + 2]
    found: list[tuple[int, int]] = []
    depth = distance_transform_edt(np.pad(unexplained, 1))
    while len(found) < count:
        row, column = np.unravel_index(int(depth.argmax()), depth.shape)
        widest = float(depth[row, column])
        if widest < thinnest:
            break
        found.append((int(row) - 1, int(column) - 1))
        radius = min(widest, reach)
        # The rim of what is left is now that of before or that of the disc.
        depth = np.minimum(depth, np.hypot(rows - row, columns - column) - radius)
    return np.array(found, dtype=np.intp).reshape(-1, 2)

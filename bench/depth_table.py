"""What heights bring to the cloth map: white garments on a white sheet, which colour cannot find, with and without depth.

    python bench/depth_table.py [--scenes 8] [--noise 2.0]

Scenes are random (`pscover.generate`); garments are as white as the sheet but for a faint shading, 8 mm high at their rims
and more within. Depth has the noise that is asked for, holes along the garments' rims, and a tilted table. For each height
from which a pixel counts as cloth: how much of the garments is found (recall), how much of what is found is garment
(precision), both of pixels, and how many garments the segmenter "classical" finds, a garment being found if more than half
of it and of one segment are the same.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

from pscover.generate.garments import garments
from pscover.perception.perceive import Perception, Settings, perceive

THICKNESS, DOME, FULL = 0.008, 0.02, 25.0
"""Metres at the rim, and above that in the middle, reached so many pixels inside."""
HEIGHTS = (0.0, 0.3, 0.5, 0.8, 1.2, 2.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """A photo, depth in millimetres, and the labels that are true."""

    photo: NDArray[np.uint8]
    depth: NDArray[np.uint16]
    labels: NDArray[np.int32]


def white_on_white(seed: int, noise: float = 2.0, count: int = 8) -> Table:
    """A scene; the noise is that of a depth in millimetres."""
    rng = np.random.default_rng(seed)
    labels = garments(count, seed).labels
    on = labels > 0
    rows, columns = np.indices(labels.shape)
    within = np.minimum(distance_transform_edt(on), FULL) / FULL
    height = on * (THICKNESS + DOME * within * rng.uniform(0.5, 1.5))
    shade = gaussian_filter(height, 2) / (THICKNESS + DOME)
    light = 225 - 12 * columns / labels.shape[1] + 3 * shade + rng.normal(0, 2, labels.shape)
    table = 1 / (1 / 0.9 + rng.uniform(-1e-4, 1e-4) * columns + rng.uniform(-1e-4, 1e-4) * rows)
    depth = np.round(1000 * (table - height) + rng.normal(0, noise, labels.shape))
    rim = on != (gaussian_filter(on.astype(float), 1.5) > 0.5)
    depth[rim | (rng.random(labels.shape) < 0.02)] = 0
    photo = np.clip(light, 0, 255).astype(np.uint8)
    return Table(photo=np.repeat(photo[:, :, None], 3, axis=2), depth=depth.astype(np.uint16), labels=labels)


def found(seen: Perception, labels: NDArray[np.int32]) -> int:
    """Garments of which more than half, and more than half of one segment, are the same pixels."""
    count = 0
    for value in range(1, int(labels.max()) + 1):
        own = labels == value
        best = int(np.bincount(seen.scene.labels[own]).argmax())
        same = seen.scene.labels == best
        both = int(np.count_nonzero(own & same))
        count += int(best > 0 and 2 * both > max(int(np.count_nonzero(own)), int(np.count_nonzero(same))))
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", type=int, default=8)
    parser.add_argument("--noise", type=float, default=2.0, help="standard deviation of a depth in millimetres")
    given = parser.parse_args()
    tables = [white_on_white(seed, given.noise) for seed in range(given.scenes)]
    print(f"{given.scenes} scenes, noise {given.noise:g} mm\ncloth_height_cm  recall  precision  garments found")
    for height in HEIGHTS:
        hit = seen_cloth = true_cloth = whole = of = 0
        for table in tables:
            seen = perceive(table.photo, depth=table.depth, settings=Settings(cloth_height_cm=height))
            cloth, true = seen.cloth_map.cloth, table.labels > 0
            hit += int(np.count_nonzero(cloth & true))
            seen_cloth += int(np.count_nonzero(cloth))
            true_cloth += int(np.count_nonzero(true))
            whole += found(seen, table.labels)
            of += int(table.labels.max())
        name = f"{height:g}" if height else "0 (colour alone)"
        print(f"{name:16s} {hit / true_cloth:6.2f}  {hit / max(1, seen_cloth):9.2f}  {whole:4d} of {of}")


if __name__ == "__main__":
    main()

"""Painted garments on tables of other kinds: how many segments a segmenter finds where nothing lies, and which garments.

python bench/surface_table.py --segmenter classical

Tables are wood of two shades, a chequered cloth, marble, tiles with grout, and plain white, black and green, all under an
uneven lamp. On each lie nothing, one garment, six apart, or five of which four reach over the picture's border. A garment is
*found* if the segment under its middle is under no other's. Garments of the table's own colour are counted as well:
`classical` cannot find them.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pscover.perception.perceive import perceive

Image = NDArray[np.float64]
Layout = tuple[tuple[int, int, int, str], ...]
HEIGHT, WIDTH = 480, 640
NOISE = 2.2
COLOURS = {
    "red": (190, 40, 45), "blue": (40, 70, 160), "green": (60, 130, 70), "white": (235, 235, 235), "black": (28, 28, 30),
    "yellow": (215, 190, 60), "grey": (120, 120, 125), "pink": (220, 140, 170),
}  # fmt: skip
LAYOUTS: dict[str, Layout] = {
    "empty": (),
    "one": ((320, 240, 70, "blue"),),
    "six": (
        (130, 130, 60, "red"), (320, 120, 60, "blue"), (500, 140, 60, "yellow"),
        (160, 340, 60, "white"), (340, 350, 60, "black"), (520, 340, 60, "grey"),
    ),
    "border": (
        (20, 100, 75, "red"), (320, 10, 75, "blue"), (630, 240, 75, "yellow"),
        (330, 470, 75, "pink"), (320, 240, 75, "green"),
    ),
}  # fmt: skip


def smooth(rng: np.random.Generator, across: float, along: float | None = None) -> Image:
    """Blurred noise of deviation 1."""
    noise = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), sigmaX=across, sigmaY=along or across)
    return np.asarray(noise / noise.std())


def plain(red: int, green: int, blue: int) -> Callable[[np.random.Generator], Image]:
    return lambda rng: np.full((HEIGHT, WIDTH, 3), (red, green, blue), dtype=float)


def wood(red: int, green: int, blue: int) -> Callable[[np.random.Generator], Image]:
    """Boards with a grain, and a joint at every 96th row."""

    def paint(rng: np.random.Generator) -> Image:
        rows = np.indices((HEIGHT, WIDTH))[0]
        warp = 14 * smooth(rng, 40)
        grain = np.sin((rows + warp) / 3.1) / 2 + 0.7 * np.sin((rows + 1.6 * warp) / 9.7) + smooth(rng, 14, 0.8) / 2
        table = plain(red, green, blue)(rng) * (1 + 0.07 * grain)[:, :, None]
        table[rows % 96 < 2] *= 0.55
        return np.asarray(table)

    return paint


def chequered(rng: np.random.Generator) -> Image:
    rows, columns = np.indices((HEIGHT, WIDTH)) // 32
    odd = ((rows + columns) % 2 == 1)[:, :, None]
    return np.where(odd, plain(225, 225, 225)(rng), plain(190, 60, 60)(rng))


def marble(rng: np.random.Generator) -> Image:
    veins = np.exp(-9 * np.abs(smooth(rng, 25) + smooth(rng, 8) / 2))
    return np.asarray(plain(225, 225, 225)(rng) + (5 * smooth(rng, 30) - 60 * veins)[:, :, None])


def tiles(rng: np.random.Generator) -> Image:
    rows, columns = np.indices((HEIGHT, WIDTH))
    table = plain(200, 190, 175)(rng)
    table[(rows % 110 < 4) | (columns % 110 < 4)] = 120, 115, 110
    return np.asarray(table * (1 + 0.03 * smooth(rng, 12))[:, :, None])


TABLES: dict[str, Callable[[np.random.Generator], Image]] = {
    "wood": wood(168, 122, 78),
    "dark wood": wood(84, 54, 36),
    "chequered": chequered,
    "marble": marble,
    "tiles": tiles,
    "white": plain(228, 228, 228),
    "black": plain(26, 26, 26),
    "green": plain(70, 140, 90),
}


def picture(table: str, layout: Layout, seed: int) -> NDArray[np.uint8]:
    """Garments with folds, rims and shadows on a table under a lamp."""
    rng = np.random.default_rng(seed)
    rows, columns = np.indices((HEIGHT, WIDTH))
    lamp = 1 - ((columns / WIDTH - 0.4) ** 2 + (rows / HEIGHT - 0.45) ** 2) / 4
    image = TABLES[table](rng) * lamp[:, :, None]
    for x, y, radius, colour in layout:
        inside = _outline(rng, x, y, radius)
        shadow = np.roll(cv2.GaussianBlur(inside.astype(float), (0, 0), 6), (4, 4), (0, 1)) * ~inside
        image *= (1 - 0.25 * shadow)[:, :, None]
        rim = np.clip(0.8 + cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, 5) / 30, 0.8, 1)
        folds = (1 + 0.1 * smooth(rng, 18) + 0.05 * smooth(rng, 5)) * rim
        image[inside] = (np.array(COLOURS[colour]) * folds[:, :, None])[inside]
    return np.clip(image + rng.normal(0, NOISE, image.shape), 0, 255).astype(np.uint8)


def _outline(rng: np.random.Generator, x: int, y: int, radius: int) -> NDArray[np.bool_]:
    turn = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    waves = sum(rng.normal(0, 0.16 / k) * np.cos(k * turn + rng.uniform(0, 2 * np.pi)) for k in range(1, 6))
    corners = np.stack([x + radius * (1 + waves) * np.cos(turn), y + radius * (1 + waves) * np.sin(turn)], axis=1)
    return np.asarray(cv2.fillPoly(np.zeros((HEIGHT, WIDTH), dtype=np.uint8), [corners.astype(np.int32)], 1) > 0)


def found(labels: NDArray[np.int32], layout: Layout) -> int:
    """Garments that are alone in the segment under their middle."""
    under = [int(labels[y, x]) for x, y, _, _ in layout]
    return sum(1 for label in under if label and Counter(under)[label] == 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--segmenter", default="classical")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--sheet", type=Path, metavar="PNG", help="all pictures, with segments in white outlines")
    given = parser.parse_args()
    print(f"{'found/garments (segments)':26s}" + "".join(f"{name:>14s}" for name in LAYOUTS))
    lines = []
    for table in TABLES:
        cells, row = [], []
        for layout in LAYOUTS.values():
            image = picture(table, layout, given.seed)
            labels = perceive(image, segmenter=given.segmenter).labels
            cells.append(f"{found(labels, layout)}/{len(layout)} ({labels.max()})")
            edge = (labels != np.roll(labels, 1, 0)) | (labels != np.roll(labels, 1, 1))
            row.append(np.where(edge[:, :, None], 255, image // 2 + image // 2 * (labels > 0)[:, :, None])[::2, ::2])
        print(f"{table:26s}" + "".join(f"{cell:>14s}" for cell in cells), flush=True)
        lines.append(np.concatenate(row, axis=1))
    if given.sheet is not None:
        cv2.imwrite(str(given.sheet), np.concatenate(lines)[:, :, ::-1].astype(np.uint8))


if __name__ == "__main__":
    main()

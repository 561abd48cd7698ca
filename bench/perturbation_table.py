"""Marked photos as other cameras, lamps and crops would show them: how many garments a segmenter still isolates.

python bench/perturbation_table.py --segmenter classical

Each row is one perturbation of every photo with marks; marks, regions of interest and the scale are moved along with the
pixels. The columns are those of `perception_table.py`. No setting is changed from row to row.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray
from perception_table import MARKS, path_of

from pscover.images import read_photo
from pscover.perception.marks import Click, MarkedPhoto, Tally, read_marks, tally
from pscover.perception.perceive import perceive

Photo = NDArray[np.uint8]
PAPER_SCALE = 4.7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shot:
    """A photo, what the eye sees in it, and its pixels a centimetre."""

    photo: Photo
    marks: MarkedPhoto
    scale: float = PAPER_SCALE


Change = Callable[[Shot], Shot]


def recoloured(change: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Change:
    """A change of values from 0 to 1 that leaves every pixel in its place."""

    def apply(shot: Shot) -> Shot:
        values = np.clip(change(shot.photo / 255.0), 0, 1)
        return Shot(photo=np.round(255 * values).astype(np.uint8), marks=shot.marks, scale=shot.scale)

    return apply


def gamma(exponent: float) -> Change:
    return recoloured(lambda values: values**exponent)


def channels(red: float, green: float, blue: float) -> Change:
    return recoloured(lambda values: values * [red, green, blue])


def noise(deviation: float) -> Change:
    return recoloured(lambda values: values + np.random.default_rng(7).normal(0, deviation / 255, values.shape))


def blur(sigma: float) -> Change:
    return recoloured(lambda values: cv2.GaussianBlur(values, (0, 0), sigma))


def lamp(left: float, right: float) -> Change:
    """Light that falls off from one side to the other."""
    return recoloured(lambda values: values * np.linspace(left, right, values.shape[1])[None, :, None])


def jpeg(quality: int) -> Change:
    def apply(shot: Shot) -> Shot:
        _, code = cv2.imencode(".jpg", shot.photo[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
        decoded = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR))
        return Shot(photo=np.ascontiguousarray(decoded[:, :, ::-1]), marks=shot.marks)

    return apply


def scaled(factor: float) -> Change:
    def apply(shot: Shot) -> Shot:
        how = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
        photo = np.asarray(cv2.resize(shot.photo, None, fx=factor, fy=factor, interpolation=how), dtype=np.uint8)
        return Shot(photo=photo, marks=moved(shot.marks, photo, lambda x, y: (x * factor, y * factor)), scale=4.7 * factor)

    return apply


def turned(quarters: int) -> Change:
    """Turned anticlockwise by quarters of a circle."""

    def apply(shot: Shot) -> Shot:
        for _ in range(quarters):
            shot = _turned_once(shot)
        return shot

    return apply


def _turned_once(shot: Shot) -> Shot:
    last = shot.photo.shape[1] - 1
    photo = np.ascontiguousarray(np.rot90(shot.photo))
    return Shot(photo=photo, marks=moved(shot.marks, photo, lambda x, y: (y, last - x)))


def mirrored(shot: Shot) -> Shot:
    photo = np.ascontiguousarray(shot.photo[:, ::-1])
    return Shot(photo=photo, marks=moved(shot.marks, photo, lambda x, y: (photo.shape[1] - 1 - x, y)))


def cropped(shot: Shot) -> Shot:
    """Cut to the region's box."""
    left, top = (max(0, min(values)) for values in zip(*shot.marks.roi, strict=True))
    right, bottom = (max(values) for values in zip(*shot.marks.roi, strict=True))
    photo = np.ascontiguousarray(shot.photo[top:bottom, left:right])
    return Shot(photo=photo, marks=moved(shot.marks, photo, lambda x, y: (x - left, y - top)))


def close(shot: Shot) -> Shot:
    """Cut to the marks' box and a fifth of the photo around it, so that garments touch the picture's edge."""
    x, y = ([getattr(click, axis) for click in shot.marks.garments] for axis in "xy")
    height, width = shot.photo.shape[:2]
    left, right = max(0, min(x) - width // 5), min(width, max(x) + width // 5)
    top, bottom = max(0, min(y) - height // 5), min(height, max(y) + height // 5)
    photo = np.ascontiguousarray(shot.photo[top:bottom, left:right])
    return Shot(photo=photo, marks=moved(shot.marks, photo, lambda x, y: (x - left, y - top)))


def moved(marks: MarkedPhoto, photo: Photo, to: Callable[[float, float], tuple[float, float]]) -> MarkedPhoto:
    """The marks of a picture whose points went elsewhere; what left the picture is moved to its edge."""
    height, width = photo.shape[:2]

    def pixel(x: float, y: float) -> tuple[int, int]:
        x, y = to(x, y)
        return int(np.clip(x, 0, width - 1)), int(np.clip(y, 0, height - 1))

    clicks = tuple(Click(name=click.name, x=x, y=y) for click in marks.garments for x, y in [pixel(click.x, click.y)])
    roi = tuple(pixel(*corner) for corner in marks.roi)
    return msgspec.structs.replace(
        marks, width=width, height=height, roi=roi, background=pixel(*marks.background), garments=clicks
    )


PERTURBATIONS: dict[str, Change] = {
    "none": lambda shot: shot,
    "gamma 0.5": gamma(0.5),
    "gamma 0.7": gamma(0.7),
    "gamma 1.4": gamma(1.4),
    "gamma 1.8": gamma(1.8),
    "warm light": channels(1.1, 1.0, 0.8),
    "cool light": channels(0.85, 1.0, 1.15),
    "half the light": channels(0.5, 0.5, 0.5),
    "overexposed": channels(1.3, 1.3, 1.3),
    "lamp on one side": lamp(1.0, 0.6),
    "noise 8": noise(8),
    "noise 16": noise(16),
    "blur 1.5": blur(1.5),
    "blur 3": blur(3),
    "JPEG 30": jpeg(30),
    "JPEG 10": jpeg(10),
    "scale 0.5": scaled(0.5),
    "scale 0.75": scaled(0.75),
    "scale 1.5": scaled(1.5),
    "scale 2": scaled(2),
    "mirrored": mirrored,
    "turned 90": turned(1),
    "turned 180": turned(2),
    "turned 270": turned(3),
    "cropped": cropped,
    "close": close,
}


def seen(shot: Shot, segmenter: str, options: dict[str, Any]) -> Tally:
    found = perceive(shot.photo, segmenter=segmenter, options=options, roi=shot.marks.roi, pixels_per_cm=shot.scale)
    return tally(found.labels, shot.marks)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--segmenter", default="classical")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter of the segmenter")
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="a perturbation; by default all")
    parser.add_argument("--photos", default="", metavar="WORD", help="only photos with this in their names")
    parser.add_argument("--verbose", action="store_true", help="also which garments are lost")
    given = parser.parse_args()
    options = dict(word.split("=", 1) for word in given.set)
    shots = [
        Shot(photo=read_photo(path), marks=marks)
        for marks in read_marks(MARKS)
        if given.photos in marks.file and (path := path_of(marks)) is not None
    ]
    print(f"{'perturbation':18s} marks found merged missed distinct segments a garment")
    for name in given.only or PERTURBATIONS:
        changed = [PERTURBATIONS[name](shot) for shot in shots]
        rows = [(shot.marks, seen(shot, given.segmenter, options)) for shot in changed]
        marks = sum(len(photo.garments) for photo, _ in rows)
        found, merged, missed = (sum(len(getattr(t, key)) for _, t in rows) for key in ("found", "merged", "missed"))
        right, distinct = (sum(len(p.distinct & set(t.found)) for p, t in rows), sum(len(p.distinct) for p, _ in rows))
        ratio = sum(t.segments for _, t in rows) / marks
        print(f"{name:18s} {marks:5d} {found:5d} {merged:6d} {missed:6d} {right:4d}/{distinct:<3d} {ratio:.2f}", flush=True)
        for photo, counts in rows if given.verbose else ():
            lost = [*(f"{each} (merged)" for each in counts.merged), *(f"{each} (missed)" for each in counts.missed)]
            if lost:
                print(f"    {photo.file}: {', '.join(lost)}")


if __name__ == "__main__":
    main()

"""Photos with marked garments through a segmenter: what is found, what the time goes into, and a contact sheet.

python bench/perception_table.py --segmenter classical --sheet sheet.png

A garment is *found* if its mark lies in a segment that holds no other mark, *merged* if it shares its segment, *missed* if
its mark lies on the surface. *Extra* segments hold no mark: parts of a split garment, or things that are no garment. The
column "distinct" counts found garments among those that touch no garment of their own colour. Photos are looked for beside
the marks and in ../shared/photos. The sheet shows photo with marks (green: found), cloth map, segments and plan, one line a
photo, cut to the region of interest.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.perception.marks import MarkedPhoto, Tally, read_marks, tally
from pscover.perception.perceive import Perception, perceive
from pscover.planning import plan

ROOT = Path(__file__).parents[1]
MARKS = ROOT / "instances" / "photos" / "marks.json"
FOLDERS = (ROOT.parent / "shared" / "photos", MARKS.parent)
TILE = 420
MARGIN = 12
PLAN_SECONDS = 20.0
"""Wall seconds for the plan of a photo."""
Picture = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Row:
    """One photo, one segmentation."""

    photo: MarkedPhoto
    perception: Perception
    tally: Tally

    @property
    def distinct_found(self) -> int:
        return len(self.photo.distinct & set(self.tally.found))


def path_of(photo: MarkedPhoto) -> Path | None:
    """Where the photo lies: by its name, or its stem as a JPEG."""
    for folder in FOLDERS:
        for name in (photo.file, f"{Path(photo.file).stem}.jpg"):
            if (folder / name).is_file():
                return folder / name
    return None


def measure(photo: MarkedPhoto, path: Path, segmenter: str, options: dict[str, Any], whole: bool) -> Row:
    seen = perceive(path, segmenter=segmenter, options=options, roi=None if whole else photo.roi)
    return Row(photo=photo, perception=seen, tally=tally(seen.labels, photo))


def print_table(rows: list[Row]) -> None:
    stages = list(dict.fromkeys(stage.name for row in rows for stage in row.perception.stages))
    print(f"{'photo':24s} marks found merged missed segments extra distinct  {'  '.join(stages)}  CPU s")
    for row in rows:
        counts = row.tally
        spent = {stage.name: stage.cpu_seconds for stage in row.perception.stages}
        print(
            f"{row.photo.file:24s} {len(row.photo.garments):5d} {len(counts.found):5d} {len(counts.merged):6d} "
            f"{len(counts.missed):6d} {counts.segments:8d} {counts.extra:5d} "
            f"{row.distinct_found:4d}/{len(row.photo.distinct):<3d} "
            + "  ".join(f"{spent.get(name, 0):{len(name)}.2f}" for name in stages)
            + f"  {row.perception.cpu_seconds:.2f}"
        )
    total: Counter[str] = Counter()
    for row in rows:
        total.update(marks=len(row.photo.garments), found=len(row.tally.found), merged=len(row.tally.merged))
        total.update(missed=len(row.tally.missed), segments=row.tally.segments, extra=row.tally.extra)
        total.update(distinct=len(row.photo.distinct), distinct_found=row.distinct_found)
    print(
        f"{len(rows)} photos: {total['found']} of {total['marks']} garments found ({total['found'] / total['marks']:.0%}), "
        f"{total['merged']} merged, {total['missed']} missed; {total['distinct_found']} of {total['distinct']} "
        f"({total['distinct_found'] / total['distinct']:.0%}) where colours differ; "
        f"{total['segments'] / total['marks']:.2f} segments a garment, {total['extra']} extra; "
        f"{np.mean([row.perception.cpu_seconds for row in rows]):.2f} CPU s a photo"
    )


def sheet(rows: list[Row]) -> Picture:
    """One line a photo: photo with marks, cloth map, segments, plan."""
    return np.concatenate([np.concatenate([_tile(view, row) for view in _views(row)], axis=1) for row in rows])


def _views(row: Row) -> list[Picture]:
    import cv2

    seen = row.perception
    photo = seen.grid.enlarged(np.asarray(seen.scene.photo))
    cloth = np.where(seen.grid.enlarged(seen.cloth_map.cloth)[:, :, None], photo, 0).astype(np.uint8)
    marked, segments = photo.copy(), _segments(photo, seen.labels)
    cv2.polylines(marked, [np.array(row.photo.roi, dtype=np.int32)], True, (255, 0, 0), 1)
    planned = _with_plan(segments.copy(), seen)
    for picture in (marked, segments):
        for click in row.photo.garments:
            good = click.name in row.tally.found
            cv2.circle(picture, (click.x, click.y), 5, (0, 255, 0) if good else (255, 0, 0), -1)
            cv2.circle(picture, (click.x, click.y), 5, (0, 0, 0), 1)
    return [marked, cloth, segments, planned]


def _segments(photo: Picture, labels: NDArray[np.int32]) -> Picture:
    colours = np.random.default_rng(5).integers(60, 256, (int(labels.max()) + 1, 3)).astype(np.uint8)
    colours[0] = 0
    picture = (photo * 0.4 + colours[labels] * 0.6).astype(np.uint8)
    edge = np.zeros(labels.shape, dtype=np.bool_)
    edge[:, 1:] |= labels[:, 1:] != labels[:, :-1]
    edge[1:] |= labels[1:] != labels[:-1]
    picture[edge] = 255
    return picture


def _with_plan(picture: Picture, seen: Perception) -> Picture:
    """The chosen grasps, numbered in order of execution: the ellipse of the gripper and its long axis."""
    import cv2

    if not seen.scene.garments:
        return picture
    chosen = plan(seen, time=PLAN_SECONDS)
    major, minor = (axis / seen.grid.factor / 2 for axis in chosen.axes)
    for number, grasp in enumerate(chosen.grasps, start=1):
        at = round(grasp.x), round(grasp.y)
        dx, dy = major * np.cos(grasp.theta), major * np.sin(grasp.theta)
        for colour, width in (((0, 0, 0), 4), ((255, 255, 0), 2)):
            cv2.ellipse(picture, at, (round(major), round(minor)), float(np.degrees(grasp.theta)), 0, 360, colour, width)
        cv2.line(picture, (round(at[0] - dx), round(at[1] - dy)), (round(at[0] + dx), round(at[1] + dy)), (0, 0, 0), 1)
        cv2.putText(picture, str(number), (at[0] - 5, at[1] + 5), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 3)
        cv2.putText(picture, str(number), (at[0] - 5, at[1] + 5), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1)
    return picture


def _tile(picture: Picture, row: Row) -> Picture:
    """The region of interest's box, as wide as all others and in its own proportions, on black."""
    import cv2

    x, y = (np.array(values) for values in zip(*row.photo.roi, strict=True))
    part = picture[max(0, y.min() - MARGIN) : y.max() + MARGIN, max(0, x.min() - MARGIN) : x.max() + MARGIN]
    tall = TILE * 3 // 4
    scale = min(TILE / part.shape[1], tall / part.shape[0])
    small = cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)[:tall, :TILE]
    tile = np.zeros((tall, TILE, 3), dtype=np.uint8)
    tile[: small.shape[0], : small.shape[1]] = small
    return tile


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--segmenter", default="classical")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter of the segmenter")
    parser.add_argument("--whole", action="store_true", help="without the regions of interest")
    parser.add_argument("--sheet", type=Path, metavar="PNG")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the counts, one object a photo")
    given = parser.parse_args()
    options = dict(word.split("=", 1) for word in given.set)
    rows = []
    for photo in read_marks(MARKS):
        path = path_of(photo)
        if path is None:
            print(f"{photo.file}: not here, skipped")
            continue
        rows.append(measure(photo, path, given.segmenter, options, given.whole))
    print_table(rows)
    if given.sheet is not None:
        import cv2

        cv2.imwrite(str(given.sheet), sheet(rows)[:, :, ::-1])
    if given.json is not None:
        fields = ("found", "merged", "missed", "segments", "extra")
        table = [
            {"file": row.photo.file, **{name: getattr(row.tally, name) for name in fields}}
            | {"cpu_seconds": {stage.name: stage.cpu_seconds for stage in row.perception.stages}}
            for row in rows
        ]
        given.json.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()

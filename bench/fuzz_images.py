"""Damage photos, label and depth images and annotation files of every format, and read them in little memory and time.

    python bench/fuzz_images.py [--mutations 5000] [--seed 0]

Every mutation must be loaded, with all masks within the image, or refused with a `PscoverError` that names the file;
anything else (another exception, no memory, a hang, a dead process) is printed with its number, which makes it again, and
makes the exit status 1. So does a word on standard error: decoders like to put some there.
"""

from __future__ import annotations

import argparse
import base64
import csv
import io
import json
import random
import resource
import selectors
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from fuzz_files import mutate
from numpy.typing import NDArray

from pscover import PscoverError
from pscover.images import read_labels, read_photo
from pscover.perception.annotations import Annotations, read_annotations, write_annotations
from pscover.perception.depth import Depth
from pscover.perception.grid import Grid
from pscover.perception.mask import Mask

MEMORY = 2 * 2**30
"""Bytes of address space of the process that reads: NumPy, SciPy and OpenCV alone take some 0.8 GiB of it."""

PRINTED = "printed on standard error"
SECONDS = 10.0
"""For one file."""

SHAPE = (48, 64)
GRID = (24, 32)
"""On which heights are made."""
PNG = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True, slots=True)
class Seed:
    """A sound file: its name (those in a folder are read as the folder) and its bytes."""

    name: str
    content: bytes

    @property
    def kind(self) -> str:
        """What is counted together: the name without its number and suffix."""
        return self.name.split("/")[0].split(".")[0]

    def load(self, path: Path) -> None:
        """Read the file as what it is; raises `AssertionError` for masks that are none of the image's."""
        if self.name.startswith("photo"):
            read_photo(path)
        elif self.name.startswith("labels"):
            read_labels(path)
        elif self.name.startswith("depth"):
            heights = Depth(image=path).heights(Grid(photo_shape=SHAPE, shape=GRID))
            assert heights.metres.shape == GRID
            assert np.isfinite(heights.metres).all()
            assert (heights.metres >= 0).all()
        found = (
            None if self.name.startswith(("photo", "depth")) else read_annotations(path.parent if "/" in self.name else path)
        )
        for mask in found.masks if found else ():
            height, width = mask.bits.shape
            assert found is not None
            assert 0 <= mask.top <= found.shape[0] - height
            assert 0 <= mask.left <= found.shape[1] - width
            assert mask.bits.any()
            assert 0 <= mask.score <= 1


def _garments() -> Annotations:
    """Overlapping discs."""
    y, x = np.indices(SHAPE)
    rng = np.random.default_rng(5)
    places = zip(rng.uniform(0, SHAPE[0], 7), rng.uniform(0, SHAPE[1], 7), rng.uniform(5, 15, 7), strict=True)
    masks = [Mask.of((y - a) ** 2 + (x - b) ** 2 < r**2, score=0.9, name=f"sock {k}") for k, (a, b, r) in enumerate(places)]
    return Annotations(masks=tuple(masks), shape=SHAPE, image="table.jpg")


def _png(pixels: NDArray[np.generic], suffix: str = ".png") -> bytes:
    return bytes(cv2.imencode(suffix, pixels)[1])


def _records(found: Annotations, segmentation: Callable[[Mask], object]) -> bytes:
    return json.dumps(
        [{"segmentation": segmentation(mask), "area": mask.area, "predicted_iou": mask.score} for mask in found.masks]
    ).encode()


def _polygons(mask: Mask) -> list[list[float]]:
    outlines = cv2.findContours(mask.pixels(SHAPE).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    return [[float(value) for value in outline.ravel()] for outline in outlines if len(outline) > 2]


def _coco(found: Annotations) -> bytes:
    items = [{"id": k, "image_id": 3, "category_id": 1, "segmentation": _polygons(m)} for k, m in enumerate(found.masks)]
    image = {"id": 3, "file_name": "table.jpg", "height": SHAPE[0], "width": SHAPE[1]}
    return json.dumps({"images": [image], "annotations": items, "categories": [{"id": 1, "name": "sock"}]}).encode()


def _labelme(found: Annotations) -> bytes:
    shapes: list[dict[str, object]] = [
        {"label": "a", "points": [[3, 4], [20, 9.5], [8, 30]], "shape_type": "polygon", "group_id": 1},
        {"label": "a", "points": [[30, 4], [40, 20]], "shape_type": "rectangle", "group_id": 1},
        {"label": "b", "points": [[30, 24], [35, 28]], "shape_type": "circle", "group_id": None},
    ]
    for mask in found.masks[:3]:
        bottom, right = mask.top + mask.bits.shape[0] - 1, mask.left + mask.bits.shape[1] - 1
        picture = base64.b64encode(_png(mask.bits.astype(np.uint8))).decode()
        corners = [[mask.left, mask.top], [right, bottom]]
        shapes.append({"label": "c", "points": corners, "shape_type": "mask", "group_id": None, "mask": picture})
    return json.dumps({"shapes": shapes, "imageHeight": SHAPE[0], "imageWidth": SHAPE[1], "imagePath": "t.jpg"}).encode()


def _arrays(write: Callable[..., None], *given: NDArray[np.generic], **named: NDArray[np.generic]) -> bytes:
    packed = io.BytesIO()
    write(packed, *given, **named)
    return packed.getvalue()


def seeds(folder: Path) -> list[Seed]:
    """Sound files of every kind; `folder` is for those that pscover writes."""
    found = _garments()
    for name, form in (("coco-runs", "coco"), ("coco-text", "coco-compressed"), ("labels-8", "label-png")):
        write_annotations(found, folder / name, format=form)
    documents = json.loads((folder / "coco-text").read_bytes()), json.loads((folder / "coco-runs").read_bytes())
    text, runs = ([item["segmentation"] for item in document["annotations"]] for document in documents)
    labels = read_labels(folder / "labels-8")
    stack = np.array([mask.pixels(SHAPE) for mask in found.masks])
    photo = np.random.default_rng(1).integers(0, 256, (*SHAPE, 3), dtype=np.uint8)
    depth = (800 + np.arange(SHAPE[1]) - 40 * (labels > 0)).astype(np.uint16)
    depth[5:9, 5:9] = 0
    table = io.StringIO()
    csv.writer(table).writerows([["id", "area", "predicted_iou"], *([k, found.masks[k].area, 0.9] for k in range(3))])
    made = {
        "photo-1.jpg": _png(photo, ".jpg"),
        "photo-2.png": _png(photo),
        "labels-8.png": (folder / "labels-8").read_bytes(),
        "depth-1.png": _png(depth),
        "depth-2.npy": _arrays(np.save, depth),
        "depth-3.npy": _arrays(np.save, (depth / 1000).astype(np.float32)),
        "labels-16.png": _png((labels * 300).astype(np.uint16)),
        "records-text.json": _records(found, lambda mask: text[found.masks.index(mask)]),
        "records-runs.json": _records(found, lambda mask: runs[found.masks.index(mask)]),
        "records-rows.json": _records(found, lambda mask: mask.pixels(SHAPE).tolist()),
        "coco-text.json": (folder / "coco-text").read_bytes(),
        "coco-runs.json": (folder / "coco-runs").read_bytes(),
        "coco-polygons.json": _coco(found),
        "labelme.json": _labelme(found),
        "numpy-labels.npy": _arrays(np.save, labels),
        "numpy-masks.npy": _arrays(np.save, stack),
        "numpy-stored.npz": _arrays(np.savez, masks=stack),
        "numpy-packed.npz": _arrays(np.savez_compressed, labels=labels, more=np.zeros(3)),
        "folder/metadata.csv": table.getvalue().encode(),
        **{f"folder/{k}.png": _png(found.masks[k].pixels(SHAPE).astype(np.uint8) * 255) for k in range(3)},
    }
    return [Seed(name, content) for name, content in made.items()]


def damaged(content: bytes, rng: random.Random) -> bytes:
    """One to three damages of any kind; of a PNG often within a part, with a checksum that fits again."""
    if content.startswith(PNG) and rng.random() < 0.5:
        return _repaired(content, rng)
    if b'"mask": "' in content and rng.random() < 0.3:
        before, _, rest = content.partition(b'"mask": "')
        picture, _, after = rest.partition(b'"')
        return before + b'"mask": "' + base64.b64encode(damaged(base64.b64decode(picture), rng)) + b'"' + after
    mutated: bytes = mutate(content, rng)
    return mutated


def _repaired(content: bytes, rng: random.Random) -> bytes:
    parts, pixels, at = [], b"", len(PNG)
    while at < len(content):
        (length,) = struct.unpack(">I", content[at : at + 4])
        kind, body = content[at + 4 : at + 8], content[at + 8 : at + 8 + length]
        if kind == b"IDAT":
            pixels += body
        else:
            parts.append((kind, body))
        at += 12 + length
    parts.insert(-1, (b"IDAT", pixels))
    chosen = rng.randrange(len(parts))
    kind, body = parts[chosen]
    if kind == b"IDAT" and rng.random() < 0.5:
        body = zlib.compress(mutate(zlib.decompress(body), rng) * rng.choice((1, 1, 1000)))
    elif kind == b"IHDR" and rng.random() < 0.5:
        sizes = [rng.choice((0, 1, 64, 48, 8192, 60_000, 2**31 - 1, 2**32 - 1)) for _ in range(2)]
        body = struct.pack(">II", *sizes) + body[8:]
    else:
        body = mutate(body, rng)
    parts[chosen] = (kind, body)
    made = [struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in parts]
    return PNG + b"".join(made)


def mutation(sound: list[Seed], seed: int, k: int) -> tuple[Seed, bytes]:
    """The k-th mutation: the file it was made of, and its content."""
    rng = random.Random(f"{seed}/{k}")
    chosen = sound[k % len(sound)]
    return chosen, damaged(chosen.content, rng)


def outcome(seed: Seed, content: bytes, sound: list[Seed], folder: Path) -> str:
    """What reading the content does: "loaded", "refused", or what went wrong."""
    path = folder / seed.name
    path.parent.mkdir(exist_ok=True)
    for other in sound:
        if "/" in other.name and "/" in seed.name:
            (folder / other.name).write_bytes(other.content)
    path.write_bytes(content)
    try:
        seed.load(path)
    except PscoverError as error:
        if "more memory" in str(error):
            return "no memory"
        return "refused" if str(folder) in str(error) else f"no file name in: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "loaded"


def read_all(seed: int, first: int, last: int) -> None:
    """In a process of its own: read mutations first..last - 1 and print the outcome and the seconds of each."""
    with tempfile.TemporaryDirectory() as work, tempfile.TemporaryDirectory() as made:
        sound = seeds(Path(made))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        for k in range(first, last):
            chosen, content = mutation(sound, seed, k)
            begun = time.perf_counter()
            said = outcome(chosen, content, sound, Path(work))
            print(json.dumps([chosen.kind, said, time.perf_counter() - begun]), flush=True)
        print(json.dumps(["peak", "", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]), flush=True)


def watch(seed: int, first: int, last: int) -> tuple[list[tuple[str, str, float]], str]:
    """Outcomes of a reading process until it ends or stays silent too long, and how it ended."""
    arguments = [sys.executable, __file__, "--read", str(seed), str(first), str(last)]
    outcomes: list[tuple[str, str, float]] = []
    with (
        tempfile.TemporaryFile() as told,
        subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=told, bufsize=0) as process,
        selectors.DefaultSelector() as selector,
    ):
        assert process.stdout is not None
        selector.register(process.stdout, selectors.EVENT_READ)
        # The first answer waits for the imports too.
        while selector.select(timeout=SECONDS if outcomes else SECONDS + 30):
            line = process.stdout.readline()
            if not line and process.wait() == 0:
                told.seek(0)
                words = told.read().decode(errors="replace")
                return outcomes, f"{PRINTED}: {words[:200]}" if words else "ended"
            if not line:
                told.seek(0)
                return outcomes, f"died with status {process.returncode}: {told.read().decode(errors='replace')[-200:]}"
            outcomes.append(tuple(json.loads(line)))
        process.kill()
    return outcomes, f"hung for {SECONDS} s"


def main() -> int:
    """Run the mutations and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutations", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--read", nargs=3, type=int, metavar=("SEED", "FIRST", "LAST"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.read:
        read_all(*given.read)
        return 0
    begun = time.perf_counter()
    counts: Counter[tuple[str, str]] = Counter()
    bad, k, slowest, peak = 0, 0, 0.0, 0.0
    while k < given.mutations:
        outcomes, end = watch(given.seed, k, given.mutations)
        if end.startswith(PRINTED):
            bad += 1
            print(end)
        elif end != "ended":
            outcomes.append(("none", end, 0.0))
        for kind, said, seconds in outcomes:
            if kind == "peak":
                peak = max(peak, seconds)
                continue
            slowest = max(slowest, seconds)
            counts[kind, said if said in ("loaded", "refused") else "BAD"] += 1
            if said not in ("loaded", "refused"):
                bad += 1
                print(f"mutation {k}: {kind}: {said}")
            k += 1
    for (kind, said), count in sorted(counts.items()):
        print(f"{kind:14} {said:8} {count}")
    print(
        f"{sum(counts.values())} mutations, {bad} bad, {time.perf_counter() - begun:.0f} s, slowest {slowest:.2f} s, "
        f"peak {peak:.0f} MiB resident of {MEMORY // 2**20} MiB of address space, seed {given.seed}"
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())

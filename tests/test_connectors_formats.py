"""Annotation formats: what is read is what was meant, whichever tool wrote it, and what is written comes back."""

from __future__ import annotations

import base64
import csv
import json
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pscover import InvalidImage, UnknownName
from pscover.encoding import encode_labels
from pscover.images import read_labels
from pscover.perception.annotations import Annotations, read_annotations, write_annotations
from pscover.perception.connectors._collect import Collector
from pscover.perception.connectors._outlines import disc, filled
from pscover.perception.connectors._rle import counts_of
from pscover.perception.connectors.label_png import masks_of_labels, painted, write_labels
from pscover.perception.connectors.sam_records import masks_of_records
from pscover.perception.connectors.supervision import masks_of_detections
from pscover.perception.mask import Mask

RECORDS = sorted((Path(__file__).parents[2] / "shared" / "sam_records").glob("*.json"))
SHAPE = (6, 8)
FIRST = np.zeros(SHAPE, dtype=np.bool_)
FIRST[1:4, 2:5] = True
SECOND = np.zeros(SHAPE, dtype=np.bool_)
SECOND[3:6, 4:8] = True
SECOND[4, 5] = False


def png(pixels: NDArray[Any]) -> bytes:
    """A grey PNG, made without the reader's library."""
    height, width = pixels.shape
    depth = 16 if pixels.dtype.itemsize == 2 else 8
    rows = b"".join(b"\x00" + row.astype(f">u{depth // 8}").tobytes() for row in pixels)
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, depth, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows)),
        (b"IEND", b""),
    )
    made = [struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in parts]
    return b"\x89PNG\r\n\x1a\n" + b"".join(made)


def written(path: Path, document: Any) -> Path:
    path.write_text(json.dumps(document))
    return path


def whole(found: Annotations) -> list[NDArray[np.bool_]]:
    return [mask.pixels(found.shape) for mask in found.masks]


def assert_both(found: Annotations) -> None:
    assert found.shape == SHAPE
    first, second = whole(found)
    assert (first == FIRST).all()
    assert (second == SECOND).all()


def runs(pixels: NDArray[np.bool_]) -> dict[str, Any]:
    return {"size": list(SHAPE), "counts": counts_of(Mask.of(pixels), SHAPE)}


def iou(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    return float((one & other).sum() / (one | other).sum())


# --- records of mask generators


@pytest.mark.parametrize("form", ["rows", "numbers", "runs", "text"])
def test_records_in_every_form(form: str, tmp_path: Path) -> None:
    coco = pytest.importorskip("pycocotools.mask")

    def segmentation(pixels: NDArray[np.bool_]) -> Any:
        if form == "rows":
            return pixels.tolist()
        if form == "numbers":
            return pixels.astype(int).tolist()
        if form == "runs":
            return runs(pixels)
        return {"size": list(SHAPE), "counts": coco.encode(np.asfortranarray(pixels, dtype=np.uint8))["counts"].decode()}

    records = [{"segmentation": segmentation(p), "area": int(p.sum()), "predicted_iou": 1.02} for p in (FIRST, SECOND)]
    found = read_annotations(written(tmp_path / "records.json", records), shape=SHAPE)
    assert_both(found)
    assert {mask.score for mask in found.masks} == {1.0}
    assert_both(masks_of_records([{**r, "area": np.int64(r["area"])} for r in records]))


def test_records_in_memory_may_hold_arrays_and_bytes() -> None:
    coco = pytest.importorskip("pycocotools.mask")
    text = coco.encode(np.asfortranarray(SECOND, dtype=np.uint8))
    assert isinstance(text["counts"], bytes)
    assert_both(masks_of_records([{"segmentation": FIRST, "predicted_iou": np.float32(0.5)}, {"segmentation": text}]))
    with pytest.raises(InvalidImage, match=r"^records: record 0: segmentation: expected booleans of shape \(H, W\) or runs"):
        masks_of_records([{"segmentation": np.zeros((2, 2, 2), dtype=bool)}])
    with pytest.raises(InvalidImage, match="expected a mapping with 'segmentation', got str"):
        masks_of_records(["mask"])  # type: ignore[list-item]


def test_a_document_of_sa_1b(tmp_path: Path) -> None:
    document = {
        "image": {"width": 8, "height": 6, "file_name": "sa_1.jpg"},
        "annotations": [{"segmentation": runs(FIRST)}, {"segmentation": runs(SECOND)}],
    }
    found = read_annotations(written(tmp_path / "sa_1.json", document))
    assert_both(found)
    assert found.image == "sa_1.jpg"


def test_a_record_whose_area_is_not_its_masks(tmp_path: Path) -> None:
    path = written(tmp_path / "r.json", [{"segmentation": runs(FIRST), "area": 20}])
    with pytest.raises(InvalidImage, match=r"r.json: \$\[0\]: expected a mask with the record's area of 20 pixels, got 9"):
        read_annotations(path)


def test_no_records_need_a_size(tmp_path: Path) -> None:
    path = written(tmp_path / "none.json", [])
    assert read_annotations(path, shape=(3, 4)).masks == ()
    with pytest.raises(InvalidImage, match=r"pass shape=\(height, width\)"):
        read_annotations(path)


def test_the_folder_that_amg_writes(tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    for k, pixels in ((0, FIRST), (7, SECOND)):
        (tmp_path / f"{k}.png").write_bytes(png(pixels.astype(np.uint8) * 255))
    with (tmp_path / "metadata.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["id", "area", "predicted_iou"], [0, 9, 0.9], [7, 11, 0.8]])
    found = read_annotations(tmp_path)
    assert_both(found)
    assert [mask.score for mask in found.masks] == [0.9, 0.8]
    (tmp_path / "metadata.csv").write_text("id,area\n../secret,3\n")
    with pytest.raises(InvalidImage, match=r"line 2: expected a whole number as id, got '../secret'"):
        read_annotations(tmp_path)
    (tmp_path / "metadata.csv").unlink()
    with pytest.raises(InvalidImage, match=r"metadata.csv: expected a file, got nothing"):
        read_annotations(tmp_path)


@pytest.mark.skipif(not RECORDS, reason="the records are not beside the checkout")
def test_real_records_are_read_without_optional_packages() -> None:
    code = (
        "import sys\n"
        "names = ('torch', 'onnxruntime', 'pycocotools', 'cv2', 'skimage', 'shapely', 'matplotlib')\n"
        "sys.modules.update(dict.fromkeys(names))\n"
        "from pscover.perception.annotations import read_annotations\n"
        "from pscover.perception.connectors.label_png import painted\n"
        "from pscover.scene import Scene\n"
        "print(Scene.of(painted(read_annotations(sys.argv[1]))).garments)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(RECORDS[0])], capture_output=True, text=True, check=True)
    assert int(done.stdout) > 3


# --- COCO


def coco_document() -> dict[str, Any]:
    square = [2, 1, 5, 1, 5, 4, 2, 4]
    return {
        "images": [
            {"id": 4, "file_name": "photos/a.jpg", "height": 6, "width": 8},
            {"id": 9, "file_name": "b.jpg", "height": 3, "width": 3},
        ],
        "categories": [{"id": 1, "name": "sock"}, {"id": 5, "name": "towel"}],
        "annotations": [
            {"id": 1, "image_id": 4, "category_id": 5, "segmentation": [square], "area": 9, "bbox": [2, 1, 3, 3]},
            {"id": 2, "image_id": 9, "category_id": 1, "segmentation": [[0, 0, 3, 0, 3, 3, 0, 3]]},
            {"id": 3, "image_id": 4, "category_id": 1, "segmentation": runs(SECOND), "iscrowd": 1},
        ],
    }


@pytest.mark.parametrize("image", ["photos/a.jpg", "a.jpg", 4, "4"])
def test_one_image_of_a_coco_document(image: str | int, tmp_path: Path) -> None:
    found = read_annotations(written(tmp_path / "coco.json", coco_document()), image=image, shape=SHAPE)
    assert_both(found)
    assert [mask.name for mask in found.masks] == ["towel", "sock"]
    assert found.image == "photos/a.jpg"


def test_which_image_must_be_said_and_known(tmp_path: Path) -> None:
    path = written(tmp_path / "coco.json", coco_document())
    with pytest.raises(InvalidImage, match=r"expected one image, got 2 \(photos/a.jpg, b.jpg\); say which"):
        read_annotations(path)
    with pytest.raises(InvalidImage, match=r"expected an image 'c.jpg', got only photos/a.jpg, b.jpg"):
        read_annotations(path, image="c.jpg")
    with pytest.raises(InvalidImage, match=r"expected masks for the image's size 9 x 9, got 3 x 3"):
        read_annotations(path, image="b.jpg", shape=(9, 9))


def test_an_object_of_several_polygons(tmp_path: Path) -> None:
    document = coco_document()
    document["annotations"] = [
        {"image_id": 9, "category_id": 1, "segmentation": [[0, 0, 1, 0, 1, 1, 0, 1], [2, 2, 3, 2, 3, 3, 2, 3]]}
    ]
    (mask,) = whole(read_annotations(written(tmp_path / "coco.json", document), image=9))
    assert mask.astype(int).tolist() == [[1, 0, 0], [0, 0, 0], [0, 0, 1]]


def test_a_list_of_results(tmp_path: Path) -> None:
    results = [{"image_id": 1, "category_id": 3, "segmentation": runs(p), "score": 0.25} for p in (FIRST, SECOND)]
    found = read_annotations(written(tmp_path / "results.json", results))
    assert_both(found)
    assert {mask.score for mask in found.masks} == {0.25}


@pytest.mark.parametrize("form", ["coco", "coco-compressed"])
def test_coco_comes_back(form: str, tmp_path: Path) -> None:
    if form == "coco-compressed":
        pytest.importorskip("pycocotools")
    masks = (Mask.of(FIRST, score=0.5, name="sock"), Mask.of(SECOND, name="Hemd 👕"))
    write_annotations(Annotations(masks=masks, shape=SHAPE, image="a.jpg"), tmp_path / "x.json", format=form)
    found = read_annotations(tmp_path / "x.json")
    assert_both(found)
    assert [(mask.score, mask.name) for mask in found.masks] == [(0.5, "sock"), (1.0, "Hemd 👕")]
    assert found.image == "a.jpg"


def test_pycocotools_reads_what_we_write(tmp_path: Path) -> None:
    coco = pytest.importorskip("pycocotools.coco")
    write_annotations(Annotations(masks=(Mask.of(FIRST), Mask.of(SECOND)), shape=SHAPE), tmp_path / "x.json")
    data = coco.COCO.__new__(coco.COCO)
    coco.COCO.__init__(data)
    data.dataset = json.loads((tmp_path / "x.json").read_text())
    with pytest.warns(DeprecationWarning, match="__array__") if np.__version__ >= "2" else pytest.MonkeyPatch.context():
        data.createIndex()
        read = [data.annToMask(data.anns[k]) for k in (1, 2)]
    assert (read[0] == FIRST).all()
    assert (read[1] == SECOND).all()


# --- outlines


def test_polygons_of_real_outlines_lose_only_the_rim() -> None:
    cv2 = pytest.importorskip("cv2")
    coco = pytest.importorskip("pycocotools.mask")
    shape = (300, 400)
    y, x = np.indices(shape)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        angle = np.arctan2(y - 150, x - 200)
        radius = 100 + sum(rng.uniform(-12, 12) * np.sin(k * angle + rng.uniform(0, 6)) for k in range(1, 6))
        garment = np.hypot(y - 150, x - 200) < radius
        outline = cv2.findContours(garment.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0][0].reshape(-1, 2)
        mask = filled(outline, shape, Collector("test"), "outline")
        assert mask is not None
        assert iou(mask.pixels(shape), garment) >= 0.97
        text = coco.merge(coco.frPyObjects([outline.ravel().astype(float).tolist()], *shape))
        theirs = read_text(text["counts"].decode(), shape)
        assert iou(mask.pixels(shape), theirs) >= 0.985


@pytest.mark.skipif(not RECORDS, reason="the records are not beside the checkout")
@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
def test_outlines_of_real_masks_lose_what_they_lose_in_pycocotools() -> None:
    cv2 = pytest.importorskip("cv2")
    coco = pytest.importorskip("pycocotools.mask")
    ours, theirs = [], []
    for path in RECORDS:
        found = read_annotations(path)
        for mask in found.masks:
            outlines = cv2.findContours(mask.pixels(found.shape).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[
                0
            ]
            outline = max(outlines, key=cv2.contourArea)
            drawn = cv2.drawContours(np.zeros(found.shape, np.uint8), [outline], -1, 1, -1) > 0
            if drawn.sum() < 10_000:
                continue
            made = filled(outline.reshape(-1, 2), found.shape, Collector("test"), "outline")
            assert made is not None
            ours.append(iou(made.pixels(found.shape), drawn))
            text = coco.merge(coco.frPyObjects([outline.ravel().astype(float).tolist()], *found.shape))
            theirs.append(iou(coco.decode(text) > 0, drawn))
    assert len(ours) > 40
    assert min(ours) >= 0.96
    assert np.median(ours) >= 0.98
    assert np.abs(np.subtract(ours, theirs)).max() <= 0.01


def read_text(text: str, shape: tuple[int, int]) -> NDArray[np.bool_]:
    return whole(masks_of_records([{"segmentation": {"size": list(shape), "counts": text}}]))[0]


corners = st.lists(st.tuples(st.integers(-24, 90), st.integers(-24, 70)), min_size=3, max_size=8)


@given(corners)
@settings(deadline=None)
def test_polygons_hold_the_pixels_whose_centres_are_inside(quarters: list[tuple[int, int]]) -> None:
    # Eighths off the centres' lines, so that no centre lies on an edge's end.
    points = [(x / 4 + 0.125, y / 4 + 0.125) for x, y in quarters]
    shape = (13, 17)
    expected = np.zeros(shape, dtype=np.bool_)
    for r, c in np.ndindex(shape):
        a, b, inside = c + 0.5, r + 0.5, False
        for (x0, y0), (x1, y1) in zip(points, points[1:] + points[:1], strict=True):
            if (y0 > b) != (y1 > b) and x0 + (b - y0) * (x1 - x0) / (y1 - y0) <= a:
                inside = not inside
        expected[r, c] = inside
    mask = filled(points, shape, Collector("test"), "outline")
    assert (expected == (np.zeros(shape) if mask is None else mask.pixels(shape))).all()


def test_neighbours_share_no_pixel_and_leave_none() -> None:
    shape = (9, 9)
    left = filled([(0, 0), (6.5, 0), (2.5, 9), (0, 9)], shape, Collector("test"), "a")
    right = filled([(6.5, 0), (9, 0), (9, 9), (2.5, 9)], shape, Collector("test"), "b")
    assert left is not None
    assert right is not None
    assert (left.pixels(shape) ^ right.pixels(shape)).all()


@pytest.mark.parametrize("radius", [0.2, 3.0, 5.5, 40.0])
def test_discs(radius: float) -> None:
    shape = (13, 17)
    y, x = np.indices(shape)
    expected = np.hypot(x + 0.5 - 8.3, y + 0.5 - 6.1) <= radius
    mask = disc((8.3, 6.1), (8.3 + radius, 6.1), shape, Collector("test"), "circle")
    assert (expected == (np.zeros(shape) if mask is None else mask.pixels(shape))).all()


# --- LabelMe


def labelme(**more: Any) -> dict[str, Any]:
    picture = base64.b64encode(png(SECOND[3:6, 4:8].astype(np.uint8))).decode()
    shapes = [
        {"label": "a", "points": [[2, 1], [5, 4]], "shape_type": "rectangle", "group_id": None, "flags": {}},
        {"label": "b", "points": [[4, 3], [7, 5]], "shape_type": "mask", "group_id": None, "mask": picture},
    ]
    return {"version": "5", "shapes": shapes, "imagePath": "a.jpg", "imageHeight": 6, "imageWidth": 8, **more}


def test_labelme(tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    found = read_annotations(written(tmp_path / "a.json", labelme(imageData="x" * 100)))
    assert_both(found)
    assert [mask.name for mask in found.masks] == ["a", "b"]


def test_shapes_of_a_group_are_one_garment(tmp_path: Path) -> None:
    part = {"shape_type": "polygon", "group_id": 3}
    shapes = [
        {"label": "a", "points": [[0, 0], [2, 0], [2, 2], [0, 2]], **part},
        {"label": "b", "points": [[0, 0], [2, 0], [2, 2], [0, 2]], **part},
        {"label": "a", "points": [[6, 4], [8, 4], [8, 6], [6, 6]], **part},
        {"label": "a", "points": [[4, 2], [5, 2], [5, 3]], "group_id": None},
    ]
    found = read_annotations(written(tmp_path / "a.json", labelme(shapes=shapes)))
    assert [(mask.name, mask.area) for mask in found.masks] == [("a", 8), ("b", 4), ("a", 1)]
    assert found.masks[0].bits.shape == SHAPE


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shape_type": "point"}, "$.shapes[0].shape_type: expected polygon, rectangle, oriented_rectangle, circle or mask"),
        ({"points": [[1, 1]]}, "$.shapes[0].points: expected two points of a rectangle, got 1"),
        ({"points": [[1, "a"], [2, 2]]}, '$.shapes[0].points[0][1]: expected float, got "a"'),
        ({"points": [[1, 1e300], [2, 2]]}, "$.shapes[0].points: point 0: expected coordinates between"),
        ({"shape_type": "polygon"}, "$.shapes[0].points: expected at least three corners (x, y), got shape (2, 2)"),
        ({"shape_type": "mask"}, "$.shapes[0].mask: expected a PNG in base64, got none"),
        ({"shape_type": "mask", "mask": "%%"}, "$.shapes[0].mask: expected a PNG in base64, got damaged text"),
        ({"shape_type": "mask", "mask": "iVBORw0KGgo="}, "$.shapes[0].mask: the PNG is cut off"),
        ({"shape_type": "mask", "points": [[0, 0], [8, 5]]}, "$.shapes[0].points: expected the upper left and the lower"),
        ({"shape_type": "mask", "mask": base64.b64encode(png(np.ones((9, 9), np.uint8))).decode()}, "expected a PNG of the"),
        ({"points": []}, "$.shapes[0].points: expected two points of a rectangle, got 0"),
        ({"points": [], "shape_type": "polygon"}, "$.shapes[0].points: expected at least three corners"),
    ],
)
def test_wrong_shapes(change: dict[str, Any], message: str, tmp_path: Path) -> None:
    document = labelme()
    document["shapes"][0].update(change)
    path = written(tmp_path / "a.json", document)
    with pytest.raises(InvalidImage) as caught:
        read_annotations(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


# --- label maps and stacks


@given(st.lists(st.lists(st.integers(0, 5), min_size=4, max_size=4), min_size=1, max_size=6))
@settings(deadline=None)
def test_label_maps_are_exact_both_ways(rows: list[list[int]]) -> None:
    labels = np.array(rows)
    found = masks_of_labels(labels, "map")
    values = [value for value in np.unique(labels) if value]
    assert len(found.masks) == len(values)
    for mask, value in zip(found.masks, values, strict=True):
        assert (mask.pixels(found.shape) == (labels == value)).all()
    assert (painted(found) == np.searchsorted([0, *values], labels)).all()


@pytest.mark.parametrize("values", [(1, 2), (1, 255), (1, 256), (9, 65535)])
def test_label_images_come_back(values: tuple[int, int], tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    labels = np.where(SECOND, values[1], FIRST * values[0])
    write_labels(labels, tmp_path / "labels.png")
    assert (read_labels(tmp_path / "labels.png") == labels).all()
    found = read_annotations(tmp_path / "labels.png")
    assert (found.masks[1].pixels(SHAPE) == SECOND).all()
    write_annotations(found, tmp_path / "again.png")
    assert (read_labels(tmp_path / "again.png") == np.where(SECOND, 2, (FIRST & ~SECOND) * 1)).all()


def test_small_masks_lie_on_large_ones() -> None:
    large, small = np.ones(SHAPE, dtype=bool), FIRST
    for masks, label in (((large, small), 2), ((small, large), 1)):
        labels = painted(Annotations(masks=tuple(Mask.of(mask) for mask in masks), shape=SHAPE))
        assert (labels == np.where(FIRST, label, 3 - label)).all()
    assert painted(Annotations(masks=(), shape=SHAPE)).tolist() == np.zeros(SHAPE).tolist()


@pytest.mark.parametrize("labels", [np.full((2, 2), 65536), np.full((2, 2), -1), np.zeros((2, 2)), np.zeros((1, 2, 2), int)])
def test_labels_that_no_png_holds(labels: NDArray[Any]) -> None:
    with pytest.raises(InvalidImage, match=r"^labels: expected"):
        encode_labels(labels)


@pytest.mark.parametrize("dtype", ["bool", "uint8", ">u2", "int64", "uint64"])
@pytest.mark.parametrize("form", ["npy", "npz", "packed", "fortran"])
def test_numpy_label_maps_and_stacks(form: str, dtype: str, tmp_path: Path) -> None:
    stack = np.stack([FIRST, SECOND]).astype(dtype)
    labels = np.where(SECOND, 2, FIRST & ~SECOND).astype(dtype)
    if form == "fortran":
        labels = np.asfortranarray(labels)
    for array, name in ((stack, "masks"), (labels, "labels")):
        path = tmp_path / f"{name}.{'npy' if form in ('npy', 'fortran') else 'npz'}"
        if path.suffix == ".npy":
            np.save(path, array)
        elif form == "npz":
            np.savez(path, **{name: array})  # type: ignore[arg-type]
        else:
            np.savez_compressed(path, **{name: array}, other=np.zeros(9))  # type: ignore[arg-type]
        found = read_annotations(path)
        if name == "masks":
            assert_both(found)
        elif dtype == "bool":
            assert (whole(found)[0] == FIRST | SECOND).all()
        else:
            assert (painted(found) == labels).all()


@pytest.mark.parametrize("large", [70_000, 2**33])
def test_labels_may_be_large(large: int, tmp_path: Path) -> None:
    np.save(tmp_path / "labels.npy", np.where(SECOND, large, FIRST & ~SECOND))
    found = read_annotations(tmp_path / "labels.npy")
    assert (painted(found) == np.where(SECOND, 2, FIRST & ~SECOND)).all()


# --- supervision


class Compact:
    """What supervision's `CompactMask` offers."""

    def __init__(self, stack: NDArray[np.bool_]) -> None:
        self.stack = stack

    def __len__(self) -> int:
        return len(self.stack)

    def __getitem__(self, k: int) -> NDArray[np.bool_]:
        return np.asarray(self.stack[k])


def test_detections() -> None:
    stack, boxes = np.stack([FIRST, SECOND]), np.zeros((2, 4))
    for masks in (stack, Compact(stack)):
        data = {"class_name": np.array(["sock", "towel"])}
        given = SimpleNamespace(mask=masks, xyxy=boxes, confidence=np.array([0.5, 0.25], np.float32), data=data)
        found = masks_of_detections(given)
        assert_both(found)
        assert [(mask.name, mask.score) for mask in found.masks] == [("sock", 0.5), ("towel", 0.25)]
    packed = SimpleNamespace(mask=None, xyxy=boxes, data={"rle_masks": [runs(FIRST), runs(SECOND)]})
    assert_both(masks_of_detections(packed))
    empty = SimpleNamespace(mask=None, xyxy=np.zeros((0, 4)), data={})
    assert masks_of_detections(empty, shape=SHAPE).masks == ()
    with pytest.raises(InvalidImage, match="expected masks, got 2 boxes without"):
        masks_of_detections(SimpleNamespace(mask=None, xyxy=boxes))
    with pytest.raises(InvalidImage, match="expected a mask for each of 2 boxes, got 1"):
        masks_of_detections(SimpleNamespace(mask=stack[:1], xyxy=boxes))


# --- the door


def test_names_and_suffixes(tmp_path: Path) -> None:
    nothing = Annotations(masks=(), shape=SHAPE)
    with pytest.raises(UnknownName, match="did you mean 'labelme'"):
        read_annotations(tmp_path / "x", format="labelm")
    with pytest.raises(InvalidImage, match=r"expected a file name that ends in one of .json, .png, got '.xyz'"):
        write_annotations(nothing, tmp_path / "x.xyz")
    with pytest.raises(InvalidImage, match="expected a format that can be written"):
        write_annotations(nothing, tmp_path / "x.json", format="labelme")


@pytest.mark.parametrize(
    "content", [b"hello", b"{}", b'{"a": 1}', b"\xff\xd8\xff", b"", b"[", b"[1]", b"\xef\xbb\xbf[]", b"PK\x03\x04"]
)
def test_files_of_other_kinds(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(content)
    with pytest.raises(InvalidImage) as caught:
        read_annotations(path)
    assert str(caught.value).startswith(f"{path}: ")

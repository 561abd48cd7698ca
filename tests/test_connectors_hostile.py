"""Files made to harm: refused with the place and the reason, and little memory taken before."""

from __future__ import annotations

import base64
import json
import pickle
import struct
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pscover import InvalidImage
from pscover.perception.annotations import read_annotations
from pscover.perception.connectors import _collect, numpy_arrays

MEMORY = 2**29


@contextmanager
def little_memory() -> Iterator[None]:
    tracemalloc.start()
    try:
        yield
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < MEMORY


def refusal(path: Path, **more: Any) -> str:
    with little_memory(), pytest.raises(InvalidImage) as caught:
        read_annotations(path, **more)
    assert str(caught.value).startswith(str(path))
    return str(caught.value).removeprefix(str(path))


def empty_png(width: int, height: int) -> bytes:
    """A grey PNG of zeros that declares a size; at most 2 MB of pixels are there."""
    content = zlib.compress(bytes(min(height * (1 + width), 2_000_000)))
    parts = ((b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)), (b"IDAT", content), (b"IEND", b""))
    made = [struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in parts]
    return b"\x89PNG\r\n\x1a\n" + b"".join(made)


def npy(descr: str, shape: str, body: bytes = b"") -> bytes:
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + body


def coco(segmentation: str, size: tuple[int, int] = (100, 100), copies: int = 1) -> str:
    item = f'{{"image_id": 1, "segmentation": {segmentation}}}'
    image = json.dumps({"id": 1, "height": size[0], "width": size[1]})
    return f'{{"images": [{image}], "annotations": [{",".join([item] * copies)}]}}'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (lambda: coco("[[0,0,1,1,2,2]]", (10**9, 10**9)), ": expected at most 67108864 pixels, got 1000000000 x 1000000000"),
        (lambda: coco("[[0,0,1,1,2,2]]", (-5, 5)), ": expected at least one pixel, got 5 x -5"),
        (lambda: coco('{"size": [1000000000, 1000000000], "counts": [1]}'), "expected int <= 67108864, got 1000000000"),
        (lambda: coco('{"size": [100, 100], "counts": [99999999999999999999, 1]}'), "counts"),
        (lambda: coco('{"size": [100, 100], "counts": [67108864, 67108864]}'), "counts that sum to 10000"),
        (lambda: coco(f'{{"size": [100, 100], "counts": "{"o" * 1000}"}}'), "cut off"),
        (lambda: coco(f'{{"size": [100, 100], "counts": "{"0" * 5_000_000}"}}'), "expected at most 4194304 characters"),
        (lambda: coco(f"[[{'0,' * 5_000_000}0]]"), "expected at most 4194304 numbers in a mask, got more"),
        (lambda: coco(f"[[{'0,0,5,9999999,' * 3000}0,0]]", (8192, 8192)), "crosses at most 4194304 rows"),
        (lambda: coco('{"size": [8192, 8192], "counts": [0, 67108864]}', (8192, 8192), 9), "boxes have at most 268435456"),
        (lambda: coco('{"size": [8192, 8192], "counts": [0, 1, 67108862, 1]}', (8192, 8192), 9), "boxes have at most"),
        (lambda: coco("1", copies=300_000), "expected at most 262144 objects"),
        (lambda: "[" * 1_000_000, "$[0]: expected object, got something else"),
        (lambda: '{"annotations": ' + "[" * 1_000_000, "nested too deeply"),
        (lambda: '[{"segmentation": ' + "[" * 1_000_000, "nested too deeply"),
        (lambda: '[{"segmentation": ' + "[" * 500 + "]" * 500 + "}]", "expected"),
        (lambda: '[{"segmentation": [[1, 0], [1]]}]', "expected rows of one length, got [1, 2]"),
        (lambda: '[{"segmentation": [[]]}]', "expected at least one pixel, got 0 x 1"),
        (lambda: '[{"segmentation": [[1, 2]]}]', "$[0].segmentation[0][1]: expected"),
        (lambda: '[{"segmentation": null}]', "$[0].segmentation: expected"),
        (lambda: "[{}]", "$[0]: expected the field 'segmentation', got an object without it"),
        (lambda: '[{"segmentation": {"size": [2, 2], "counts": [4]}, "area": NaN}]', "JSON does not have"),
        (lambda: coco("[]"), "expected polygons or runs, got an empty list; a box is no mask"),
        (lambda: coco("[[0, 0, 1]]"), "$.annotations[0].segmentation[0]: expected x and y of each corner, got 3 numbers"),
        (lambda: coco("[[0, 0, 1, 1]]"), "expected at least three corners"),
    ],
)
def test_hostile_documents(text: Callable[[], str], message: str, tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text(text())
    assert message in refusal(tmp_path / "x.json")


@pytest.mark.parametrize("segmentation", ["[[0, 0.6, 90, 0.6, 90, 0.7]]", '{"size": [100, 100], "counts": [10000]}'])
def test_many_masks_without_a_pixel(segmentation: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_collect, "WORK_LIMIT", 100 * _collect.LEAST_WORK)
    (tmp_path / "x.json").write_text(coco(segmentation, copies=100))
    assert read_annotations(tmp_path / "x.json").masks == ()
    (tmp_path / "x.json").write_text(coco(segmentation, copies=101))
    assert "pixels of work to decode" in refusal(tmp_path / "x.json")


@pytest.mark.parametrize("segmentation", ["[[0,0,2000,2000,2000,2000.1]]", f"[[{'0,0,0.1,2000,' * 50}0,0]]"])
def test_outlines_that_cost_more_than_they_hold(segmentation: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_collect, "WORK_LIMIT", 2**26)
    (tmp_path / "x.json").write_text(coco(segmentation, (2000, 2000), copies=2))
    read_annotations(tmp_path / "x.json")
    (tmp_path / "x.json").write_text(coco(segmentation, (2000, 2000), copies=8))
    assert "pixels of work to decode" in refusal(tmp_path / "x.json")


def test_many_masks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_collect, "MASK_LIMIT", 100)
    for copies in (100, 101):
        (tmp_path / "x.json").write_text(coco('{"size": [100, 100], "counts": [0, 1, 9999]}', copies=copies))
        if copies == 100:
            assert len(read_annotations(tmp_path / "x.json").masks) == 100
    assert "expected at most 100 masks, got more" in refusal(tmp_path / "x.json")


def test_a_png_bomb_within_labelme(tmp_path: Path) -> None:
    shape = {"label": "a", "points": [[0, 0], [8191, 8191]], "shape_type": "mask"}
    bomb = base64.b64encode(empty_png(60_000, 60_000)).decode()
    document = {"shapes": [{**shape, "mask": bomb}], "imageHeight": 8192, "imageWidth": 8192}
    (tmp_path / "x.json").write_text(json.dumps(document))
    assert "expected a PNG of the points' box, 8192 x 8192, got 60000 x 60000" in refusal(tmp_path / "x.json")
    document["shapes"] = [{**shape, "mask": base64.b64encode(empty_png(8192, 8192)).decode()}]
    (tmp_path / "x.json").write_text(json.dumps(document))
    assert "holds fewer pixels than its header declares" in refusal(tmp_path / "x.json")


def test_joined_parts_far_apart_are_counted_by_their_box(tmp_path: Path) -> None:
    spots = ([[0, 0], [1, 0], [1, 1], [0, 1]], [[8190, 8190], [8192, 8190], [8192, 8192]])
    shapes = [{"label": "a", "group_id": k, "points": spot} for k in range(6) for spot in spots]
    (tmp_path / "x.json").write_text(json.dumps({"shapes": shapes, "imageHeight": 8192, "imageWidth": 8192}))
    assert "boxes have at most 268435456 pixels" in refusal(tmp_path / "x.json")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (npy("'|O'", "(2, 2)", pickle.dumps([1])), "got the type '|O'; pickled objects are not read"),
        (npy("'<f8'", "(2, 2)", bytes(32)), "got the type '<f8'; convert with .astype(int), or > 0.5 for masks"),
        (npy("[('a', '<i4')]", "(2, 2)", bytes(16)), "expected a header with descr, fortran_order and shape"),
        (npy("'<i4'", "(100000, 100000)"), "expected at most 67108864 pixels, got 100000 x 100000"),
        (npy("'<i4'", "(8192, 8192)"), "expected 268435456 bytes for 8192 x 8192 of int32, got 0"),
        (npy("'|b1'", "(1000000000, 2, 2)"), "expected at most 16384 masks, got 1000000000"),
        (npy("'|b1'", "(16384, 8192, 8192)"), "[0]: expected 67108864 bytes for 8192 x 8192 of bool, got 0"),
        (npy("'|b1'", "(2, 2)", bytes(5)), "expected as many bytes as the header declares, got more"),
        (npy("'|b1'", "(4,)", bytes(4)), "expected labels of shape (H, W) or masks of shape (N, H, W), got (4,)"),
        (npy("'|b1'", "(0, 4)"), "expected at least one pixel, got 4 x 0"),
        (npy("'<i4'", "(1, 2)", struct.pack("<ii", -3, 1)), "pixel x=0, y=0: expected a label from 0, got -3"),
        (b"\x93NUMPY\x09\x00", "version 1 to 3"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff", "expected a header"),
    ],
)
def test_hostile_arrays(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "x.npy").write_bytes(content)
    assert message in refusal(tmp_path / "x.npy")
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("masks.npy", content)
    assert message in refusal(tmp_path / "x.npz")


def test_an_archive_that_unpacks_to_more_than_it_may(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.savez_compressed(tmp_path / "x.npz", masks=np.zeros((40, 512, 512), dtype=bool))
    assert (tmp_path / "x.npz").stat().st_size < 2**16
    assert read_annotations(tmp_path / "x.npz").masks == ()
    monkeypatch.setattr(numpy_arrays, "UNPACKED_LIMIT", 2**20)
    assert "masks: expected at most 1048576 bytes unpacked, got 10485888" in refusal(tmp_path / "x.npz")


def test_archives_of_other_things(tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", a=np.zeros((2, 2)), b=np.zeros(3))
    assert "expected an array 'masks' or 'labels', got a, b" in refusal(tmp_path / "x.npz")
    with zipfile.ZipFile(tmp_path / "x.npz", "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("masks.npy", npy("'|b1'", "(2, 2)", bytes(4)))
    assert "expected a stored or deflated array" in refusal(tmp_path / "x.npz")
    (tmp_path / "x.npz").write_bytes((tmp_path / "x.npz").read_bytes()[:60])
    assert "expected NumPy's format, got a damaged file" in refusal(tmp_path / "x.npz")


def test_many_labels(tmp_path: Path) -> None:
    np.save(tmp_path / "x.npy", np.arange(1, 300 * 300 + 1).reshape(300, 300))
    assert "expected at most 16384 labels, got 90000" in refusal(tmp_path / "x.npy")
    rows = np.arange(2048 * 2048, dtype=np.int32).reshape(2048, 2048) % 100 + 1
    np.save(tmp_path / "x.npy", rows)
    assert "boxes have at most 268435456 pixels" in refusal(tmp_path / "x.npy")


def test_large_files(tmp_path: Path) -> None:
    with (tmp_path / "x.json").open("wb") as file:
        file.write(b"[")
        file.truncate(2**27)
    assert "expected at most 67108864 bytes, got 134217728" in refusal(tmp_path / "x.json")


def test_pipes_and_missing_files(tmp_path: Path) -> None:
    assert "there is no such file" in refusal(tmp_path / "nothing")
    assert "no such file" in refusal(tmp_path / "nothing", format="coco")

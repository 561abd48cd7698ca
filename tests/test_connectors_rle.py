"""Run-length encoding: exact both ways, the same as pycocotools writes it, and never believed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pscover import InvalidImage
from pscover.perception.annotations import Annotations, read_annotations, write_annotations
from pscover.perception.connectors._collect import Collector
from pscover.perception.connectors._rle import Rle, counts_of, decoded, from_text, text_of
from pscover.perception.mask import Mask

RECORDS = sorted((Path(__file__).parents[2] / "shared" / "sam_records").glob("*.json"))

sizes = st.tuples(st.integers(1, 9), st.integers(1, 9))
images = sizes.flatmap(
    lambda size: st.lists(st.booleans(), min_size=size[0] * size[1], max_size=size[0] * size[1]).map(
        lambda bits: np.array(bits).reshape(size)
    )
)


def runs(pixels: NDArray[np.bool_]) -> list[int]:
    """Runs down the columns, counted pixel by pixel."""
    counts, inside = [0], False
    for pixel in pixels.T.ravel().tolist():
        if pixel != inside:
            counts.append(0)
            inside = pixel
        counts[-1] += 1
    return counts


def mask(counts: str | list[int], size: tuple[int, int]) -> Mask | None:
    return decoded(Rle(size, counts), None, Collector("file"), "file: mask")


@given(images)
@settings(deadline=None)
def test_runs_are_exact_both_ways(pixels: NDArray[np.bool_]) -> None:
    shape = (pixels.shape[0], pixels.shape[1])
    found = mask(runs(pixels), shape)
    if found is None:
        assert not pixels.any()
    else:
        assert (found.pixels(shape) == pixels).all()
        assert found.bits[0].any()
        assert found.bits[:, -1].any()
        assert counts_of(found, shape) == runs(pixels)


@given(images)
@settings(deadline=None)
def test_compressed_text_is_what_pycocotools_writes_and_reads(pixels: NDArray[np.bool_]) -> None:
    coco = pytest.importorskip("pycocotools.mask")
    shape = (pixels.shape[0], pixels.shape[1])
    text = coco.encode(np.asfortranarray(pixels, dtype=np.uint8))["counts"].decode()
    assert from_text(text, "text").tolist() == runs(pixels)
    assert text_of(runs(pixels), shape) == text


@given(st.lists(st.integers(0, 2**20), min_size=1, max_size=12))
@settings(deadline=None)
def test_large_counts_survive_compression(counts: list[int]) -> None:
    pytest.importorskip("pycocotools.mask")
    assert from_text(text_of(counts, (sum(counts), 1)), "text").tolist() == counts


def test_runs_without_length_in_the_middle_are_joined() -> None:
    found = mask([1, 2, 0, 1, 2], (3, 2))
    assert found is not None
    assert found.pixels((3, 2)).astype(int).tolist() == [[0, 1], [1, 0], [1, 0]]


@pytest.mark.parametrize(
    ("counts", "size", "message"),
    [
        ([1, 2], (2, 2), "expected counts that sum to 4, the image's pixels, got 3"),
        ([1, 2, 2], (2, 2), "expected counts that sum to 4, the image's pixels, got 5"),
        ([], (2, 2), "expected counts that sum to 4, the image's pixels, got 0"),
        ("", (2, 2), "expected counts that sum to 4, the image's pixels, got 0"),
        ([10**9], (10**5, 10**4), "expected at most 67108864 pixels, got 10000 x 100000; scale it down"),
        ("5", (4, 5), "expected counts that sum to 20, the image's pixels, got 5"),
        ("52P", (4, 5), "expected the rest of a count, got the end of the text: it is cut off"),
        ("52\x00", (4, 5), "character 2: expected a digit from '0' to 'o', got '\\x00'"),
        ("52é", (4, 5), "character 2: expected a digit from '0' to 'o', got 'é'"),
        ("O", (4, 5), "count 0: expected a number from 0 to 67108864, got -1"),
        ("o" * 40 + "0", (4, 5), "expected counts of at most 7 digits, got 41"),
        ("oooooo?", (4, 5), "count 0: expected a number from 0 to 67108864, got 17179869183"),
    ],
)
def test_wrong_runs(counts: str | list[int], size: tuple[int, int], message: str) -> None:
    with pytest.raises(InvalidImage) as caught:
        mask(counts, size)
    assert str(caught.value) == f"file: mask: {message}"


@pytest.mark.parametrize("path", RECORDS or [None], ids=lambda path: "none" if path is None else path.stem)
def test_real_records(path: Path | None) -> None:
    if path is None:
        pytest.skip("the records are not beside the checkout")
    found, records = read_annotations(path), json.loads(path.read_text())
    assert len(found.masks) == len(records) > 0
    for ours, record in zip(found.masks, records, strict=True):
        assert list(found.shape) == record["segmentation"]["size"]
        assert ours.area == record["area"]
        x, y, width, height = record["bbox"]
        assert (ours.left, ours.top, ours.bits.shape) == (x, y, (height, width))
        assert ours.score == min(record["predicted_iou"], 1.0)


@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
@pytest.mark.parametrize("path", RECORDS or [None], ids=lambda path: "none" if path is None else path.stem)
def test_real_records_agree_with_pycocotools_and_come_back(path: Path | None, tmp_path: Path) -> None:
    coco = pytest.importorskip("pycocotools.mask")
    if path is None:
        pytest.skip("the records are not beside the checkout")
    found, records = read_annotations(path), json.loads(path.read_text())
    for ours, record in zip(found.masks, records, strict=True):
        assert (ours.pixels(found.shape) == coco.decode(record["segmentation"])).all()
    for form in ("coco", "coco-compressed"):
        write_annotations(found, tmp_path / "again.json", format=form)
        assert_same(read_annotations(tmp_path / "again.json", shape=found.shape), found)
    written: list[dict[str, Any]] = json.loads((tmp_path / "again.json").read_text())["annotations"]
    assert [item["segmentation"] for item in written] == [record["segmentation"] for record in records]


def assert_same(left: Annotations, right: Annotations) -> None:
    assert left.shape == right.shape
    assert len(left.masks) == len(right.masks)
    for one, other in zip(left.masks, right.masks, strict=True):
        assert (one.top, one.left, one.score) == (other.top, other.left, other.score)
        assert (one.bits == other.bits).all()

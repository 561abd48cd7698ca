"""From photo to scene."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings, UnknownName

cv2 = pytest.importorskip("cv2")
pytest.importorskip("skimage")
from pscover.perception.cloth import ClothSettings  # noqa: E402
from pscover.perception.grid import Grid  # noqa: E402
from pscover.perception.marks import MarkedPhoto, read_marks, tally  # noqa: E402
from pscover.perception.mask import Mask  # noqa: E402
from pscover.perception.perceive import Settings, perceive  # noqa: E402
from pscover.perception.segmenter import Segmentation  # noqa: E402
from pscover.perception.segmenters.classical import Classical  # noqa: E402

ROOT = Path(__file__).parents[1]
PHOTOS = ROOT / "instances" / "photos"
SHARED = ROOT.parent / "shared" / "photos"
MARKS = {Path(photo.file).stem: photo for photo in read_marks(PHOTOS / "marks.json")}
SHIPPED = ("tshirts_0_ex2", "tshirts_244_color", "tshirts_363_color")


def folded(height: int = 240, width: int = 320) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """Three garments with folds on a shaded surface, two of them touching."""
    truth = np.zeros((height, width), dtype=np.int32)
    truth[30:150, 30:130], truth[60:180, 130:220], truth[190:230, 240:310] = 1, 2, 3
    colours = np.array([(150, 145, 135), (190, 50, 60), (60, 90, 170), (230, 220, 90)], dtype=float)
    y, x = np.mgrid[:height, :width]
    folds = 1 - 0.25 * (np.sin(x / 9 + y / 15) > 0.8) - 0.12 * np.sin(y / 20)
    light = 1.1 - 0.3 * x / width
    image = colours[truth] * light[:, :, None] * np.where(truth > 0, folds, 1)[:, :, None]
    noisy = image + np.random.default_rng(0).normal(0, 3, image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), truth


def test_folded_garments_are_whole() -> None:
    photo, truth = folded()
    seen = perceive(photo)
    labels = seen.scene.labels
    assert seen.scene.garments == 3
    for garment in (1, 2, 3):
        inside = truth == garment
        best = np.bincount(labels[inside]).argmax()
        assert best > 0
        same = labels == best
        assert np.count_nonzero(inside & same) > 0.9 * np.count_nonzero(inside | same)


def test_labels_lie_on_cloth_and_cover_it() -> None:
    photo, _ = folded()
    seen = perceive(photo)
    assert not seen.scene.labels[~seen.cloth_map.cloth].any()
    assert np.count_nonzero(seen.scene.labels) > 0.98 * np.count_nonzero(seen.cloth_map.cloth)
    assert len(seen.scores) == seen.scene.garments
    assert [stage.name for stage in seen.stages] == [
        "read", "cloth", "features", "regions", "merging", "boundaries", "clean-up"
    ]  # fmt: skip
    assert seen.provenance.background == "auto"
    assert "Classical(" in seen.provenance.segmenter


def test_classical_masks_are_disjoint_connected_and_cover_the_cloth() -> None:
    photo, truth = folded()
    masks = Classical().segment(photo, truth > 0).masks
    count = np.zeros(truth.shape, dtype=int)
    for mask in masks:
        count[mask.window] += mask.bits
        assert cv2.connectedComponents(mask.bits.astype(np.uint8), connectivity=4)[0] == 2
    assert (count == (truth > 0)).all()
    assert Classical().segment(photo, np.zeros_like(truth, dtype=bool)).masks == ()


def test_garments_of_one_colour_that_touch_are_one_segment() -> None:
    """What the documentation says classical cannot do."""
    photo = np.full((200, 300, 3), 120, dtype=np.uint8)
    photo[50:150, 50:250] = 160, 200, 230
    assert perceive(photo).scene.garments == 1


@pytest.mark.parametrize("scale", [2, 4])
def test_a_finer_photo_gives_the_same_scene_and_its_own_pixels(scale: int) -> None:
    photo, _ = folded()
    large = cv2.resize(photo, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    seen = perceive(
        large, pixels_per_cm=4.7 * scale, basket=(319.5 * scale, 0), roi=[(0, 0), (9999, 0), (9999, 9999), (0, 9999)]
    )
    assert seen.grid.shape == photo.shape[:2]
    assert seen.scene.pixels_per_cm == pytest.approx(4.7)
    assert seen.scene.garments == 3
    assert seen.labels.shape == large.shape[:2]
    assert (seen.labels[scale // 2 :: scale, scale // 2 :: scale] == seen.scene.labels).all()
    assert seen.grid.to_photo(*seen.scene.basket) == pytest.approx((319.5 * scale, 0))


def test_the_grid_leads_there_and_back() -> None:
    grid = Grid.over((2160, 3840))
    assert grid.shape[0] * grid.shape[1] <= 401_000
    assert grid.from_photo(*grid.to_photo(12.5, 7)) == pytest.approx((12.5, 7))
    assert grid.to_photo(-0.5, -0.5) == pytest.approx((-0.5, -0.5))
    assert Grid.over((3, 5000), pixel_limit=10).shape[0] == 1
    for wrong in (0, -1, float("nan")):
        with pytest.raises(InvalidSettings, match="pixels_per_cm: expected a positive"):
            Grid.over((2, 2), pixels_per_cm=wrong)


@pytest.mark.parametrize("stem", SHIPPED)
def test_shipped_photos(stem: str) -> None:
    marked = MARKS[stem]
    seen = perceive(PHOTOS / f"{stem}.jpg", roi=marked.roi)
    counts = tally(seen.labels, marked)
    assert not counts.missed
    assert marked.distinct <= set(counts.found)
    assert counts.extra <= len(marked.garments) + 1
    assert seen.scene.source.endswith(f"{stem}.jpg")


def test_all_photos_where_colours_differ() -> None:
    if not SHARED.is_dir():
        pytest.skip("the other photos are not shipped: put them into ../shared/photos")
    found = distinct = garments = segments = 0
    for marked in MARKS.values():
        counts = tally(perceive(SHARED / marked.file, roi=marked.roi).labels, marked)
        distinct += len(marked.distinct)
        found += len(marked.distinct & set(counts.found))
        garments += len(marked.garments)
        segments += counts.segments
    assert found >= 0.75 * distinct
    assert segments <= 1.3 * garments


@pytest.mark.parametrize("stem", SHIPPED)
def test_without_a_region_of_interest_no_garment_is_lost(stem: str) -> None:
    marked = MARKS[stem]
    assert not tally(perceive(PHOTOS / f"{stem}.jpg").labels, marked).missed


class Stencil:
    """A segmenter from outside that reports no stages."""

    name: ClassVar[str] = "stencil"
    requires: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    def segment(self, photo: NDArray[np.uint8], cloth: NDArray[np.bool_]) -> Segmentation:
        bits = np.zeros(cloth.shape, dtype=np.bool_)
        bits[190:230, 240:310] = True
        return Segmentation(masks=(Mask.of(bits, score=0.7, name="towel"),))


def test_a_segmenter_given_as_an_object() -> None:
    photo, _ = folded()
    seen = perceive(photo, segmenter=Stencil())
    assert "towel" in seen.scene.names
    assert seen.scores[seen.scene.names.index("towel")] == 0.7
    assert seen.scene.garments == 3, "the uncovered rest becomes segments of its own, by colour"
    assert [stage.name for stage in seen.stages] == ["read", "cloth", "segment", "clean-up"]
    by_mask = perceive(photo, segmenter=Stencil(), settings=Settings(cloth=ClothSettings(decision="mask")))
    assert by_mask.scene.garments == 3


@pytest.mark.parametrize("shape", [(1, 1, 3), (2, 2), (9, 1, 3)])
def test_tiny_photos_show_nothing(shape: tuple[int, ...]) -> None:
    assert perceive(np.full(shape, 90, dtype=np.uint8)).scene.garments == 0


def test_wrong_arguments(tmp_path: Path) -> None:
    photo, _ = folded()
    with pytest.raises(UnknownName, match="did you mean 'classical'"):
        perceive(photo, segmenter="clasical")
    with pytest.raises(UnknownName, match="parameter of segmenter 'classical'"):
        perceive(photo, options={"limits": 3})
    with pytest.raises(InvalidSettings, match="spacing: expected"):
        perceive(photo, options={"spacing": "1"})
    with pytest.raises(InvalidSettings, match="roi: no pixel"):
        perceive(photo, roi="900,900 950,900 950,950")
    with pytest.raises(InvalidSettings, match="options: expected none"):
        perceive(photo, segmenter=Stencil(), options={"a": 1})
    with pytest.raises(InvalidImage, match="no such file"):
        perceive(tmp_path / "none.jpg")
    with pytest.raises(InvalidImage, match="photo: expected 8-bit RGB"):
        perceive(np.zeros((4, 4, 3)))


def test_marks_are_inside_their_photos_and_regions(tmp_path: Path) -> None:
    from pscover.perception.roi import region

    for marked in MARKS.values():
        inside = region(marked.roi, (marked.height, marked.width))
        assert all(inside[click.y, click.x] for click in marked.garments)
        names = [click.name for click in marked.garments]
        assert len(set(names)) == len(names)
        assert {name for pair in marked.same_colour for name in pair} <= set(names)
    (tmp_path / "marks.json").write_text('{"format": "pscover-marks", "version": 2}')
    with pytest.raises(InvalidImage, match=r"marks\.json: expected marks"):
        read_marks(tmp_path / "marks.json")
    photo = MarkedPhoto(file="a", width=5, height=4, roi=(), background=(0, 0), garments=())
    with pytest.raises(InvalidImage, match="labels: expected the size 5 x 4 of a, got 3 x 2"):
        tally(np.zeros((2, 3), dtype=np.int32), photo)

"""What the surface looks like, and which pixels show cloth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings

cv2 = pytest.importorskip("cv2")
from pscover.perception.background import Auto, Colour, EmptyTable, parse_background  # noqa: E402
from pscover.perception.cloth import ClothSettings, cloth_by_mask, cloth_map, majority  # noqa: E402
from pscover.perception.colour import lab, rgb  # noqa: E402
from pscover.perception.mask import Mask  # noqa: E402
from pscover.perception.roi import filled, parse_polygon, region, void  # noqa: E402

BoolImage = NDArray[np.bool_]
SHAPE = (240, 320)


def picture(
    *garments: tuple[slice, slice, tuple[int, int, int]],
    surface: tuple[int, int, int] = (150, 140, 125),
    falloff: float = 0.0,
    noise: float = 2.0,
    seed: int = 0,
) -> tuple[NDArray[np.uint8], BoolImage]:
    """Flat garments on a lit surface, and where they lie."""
    image = np.empty((*SHAPE, 3))
    image[:] = surface
    truth = np.zeros(SHAPE, dtype=np.bool_)
    for rows, columns, colour in garments:
        image[rows, columns] = colour
        truth[rows, columns] = True
    y, x = np.mgrid[-1 : 1 : SHAPE[0] * 1j, -1 : 1 : SHAPE[1] * 1j]
    light = 1 - falloff * ((x - 0.3) ** 2 + (y + 0.2) ** 2) / 3
    image = image * light[:, :, None] + np.random.default_rng(seed).normal(0, noise, image.shape)
    return np.clip(image, 0, 255).astype(np.uint8), truth


def iou(one: BoolImage, two: BoolImage) -> float:
    return float(np.count_nonzero(one & two) / np.count_nonzero(one | two))


RED = (slice(60, 140), slice(60, 160), (180, 40, 50))
BLUE = (slice(100, 200), slice(170, 270), (40, 70, 150))


@pytest.mark.parametrize("falloff", [0.0, 0.4, 0.7])
@pytest.mark.parametrize("background", [Auto(), Colour(150, 140, 125)])
def test_flat_garments_on_a_shaded_surface(falloff: float, background: Auto | Colour) -> None:
    photo, truth = picture(RED, BLUE, falloff=falloff)
    assert iou(cloth_map(photo, background).cloth, truth) > 0.95


def test_a_surface_fitted_beats_a_constant_one() -> None:
    photo, truth = picture(RED, falloff=0.9)
    found = cloth_map(photo)
    constant = np.linalg.norm((lab(photo) - found.surface.colours[0, 0]) * [0.5, 1, 1], axis=2) > 14
    assert iou(found.cloth, truth) > iou(constant, truth) + 0.1


def test_a_garment_that_touches_the_border_is_not_the_surface() -> None:
    photo, truth = picture((slice(0, 240), slice(0, 120), (180, 40, 50)))
    assert iou(cloth_map(photo).cloth, truth) > 0.97


def test_a_floor_of_two_colours() -> None:
    photo, _ = picture()
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    photo[(y // 30 + x // 30) % 2 == 0] = 90, 60, 40
    photo[80:180, 100:220] = 30, 60, 200
    found = cloth_map(photo)
    truth = np.zeros(SHAPE, dtype=np.bool_)
    truth[80:180, 100:220] = True
    assert len(found.surface.colours) == 2
    assert iou(found.cloth, truth) > 0.9


@pytest.mark.parametrize("light", [1.0, 0.6, 0.35])
def test_a_garment_like_the_surface_is_found_in_any_light(light: float) -> None:
    photo, truth = picture((slice(60, 140), slice(60, 160), (165, 205, 215)), surface=(190, 188, 182), noise=0.5)
    found = cloth_map((photo * light).astype(np.uint8))
    assert iou(found.cloth, truth) > 0.95
    assert found.threshold <= 14


def test_a_shadow_is_surface() -> None:
    photo, _ = picture()
    photo[80:160, 80:200] = (photo[80:160, 80:200] * 0.65).astype(np.uint8)
    assert not cloth_map(photo).cloth.any()


def test_a_photo_of_the_empty_table() -> None:
    empty, _ = picture(falloff=0.5, seed=1)
    empty[150:, :40] = 20, 160, 60
    photo, truth = picture(RED, falloff=0.5)
    photo[150:, :40] = 20, 160, 60
    brighter = np.clip(photo * 1.06, 0, 255).astype(np.uint8)
    assert iou(cloth_map(brighter, EmptyTable(empty)).cloth, truth) > 0.95
    with pytest.raises(InvalidImage, match=r"empty table of the photo's size 320 x 240, got 160 x 240"):
        cloth_map(photo, EmptyTable(np.ascontiguousarray(empty[:, :160])))


def test_grey_photos_go_by_lightness_alone() -> None:
    grey = np.full(SHAPE, 150, dtype=np.uint8)
    grey[60:140, 60:160] = 200
    found = cloth_map(rgb(grey))
    assert found.surface.weights.tolist() == [1, 1, 1]
    assert found.cloth[100, 100]
    assert not found.cloth[10, 10]


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (2, 3), (7, 7)])
@pytest.mark.parametrize("value", [0, 128, 255])
def test_tiny_and_uniform_photos_have_no_cloth(shape: tuple[int, int], value: int) -> None:
    assert not cloth_map(np.full((*shape, 3), value, dtype=np.uint8)).cloth.any()


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 3, 5]), st.integers(0, 3))
@settings(max_examples=25, deadline=None)
def test_the_convolutions_by_brute_force(seed: int, kernel: int, rounds: int) -> None:
    rng = np.random.default_rng(seed)
    height, width = int(rng.integers(1, 12)), int(rng.integers(1, 12))
    bits, inside = rng.random((height, width)) < 0.5, rng.random((height, width)) < 0.8

    def around(image: BoolImage, y: int, x: int) -> BoolImage:
        reach = kernel // 2
        return image[max(0, y - reach) : y + reach + 1, max(0, x - reach) : x + reach + 1]

    expected = bits & inside
    for _ in range(rounds):
        expected = np.array(
            [
                [inside[y, x] and 2 * around(expected, y, x).sum() > around(inside, y, x).sum() for x in range(width)]
                for y in range(height)
            ],
            dtype=np.bool_,
        )
    assert (majority(bits, kernel, rounds, inside=inside) == expected).all()


def test_joints_of_boards_and_the_grout_of_tiles_are_surface() -> None:
    photo, truth = picture(RED, BLUE, surface=(200, 190, 175))
    lines = np.zeros(SHAPE, dtype=np.bool_)
    lines[:2] = lines[120:125] = lines[:, 200:205] = True
    photo[lines & ~truth] = 90, 70, 50
    assert iou(cloth_map(photo).cloth, truth) > 0.93
    assert cloth_map(photo, settings=ClothSettings(thinnest=1)).cloth[122, 30]


def test_a_strap_is_cloth() -> None:
    photo, truth = picture(RED, (slice(140, 200), slice(80, 92), (180, 40, 50)))
    assert iou(cloth_map(photo).cloth, truth) > 0.95


def test_the_cloth_map_is_read_only_and_inside() -> None:
    photo, _ = picture(RED)
    inside = region([(0, 0), (100, 0), (100, 239), (0, 239)], SHAPE)
    found = cloth_map(photo, inside=inside)
    assert not (found.cloth & ~inside).any()
    assert found.cloth[100, 80]
    for buffer in (found.cloth, found.inside, found.distance):
        assert not buffer.flags.writeable


def test_by_mask_white_socks_on_a_white_sheet_are_cloth() -> None:
    photo, _ = picture(surface=(240, 240, 238), noise=1.0)
    pixelwise = cloth_map(photo)
    assert not pixelwise.cloth.any()
    sock, sheet = np.zeros(SHAPE, dtype=np.bool_), np.ones(SHAPE, dtype=np.bool_)
    sock[100:140, 100:130] = True
    sheet[sock] = False
    corner = np.zeros(SHAPE, dtype=np.bool_)
    corner[:20, :20] = True
    found = cloth_by_mask(pixelwise, (Mask.of(sheet), Mask.of(sock), Mask.of(corner)), ClothSettings())
    assert (found.cloth == sock).all()


def test_backgrounds_from_text(tmp_path: Path) -> None:
    assert parse_background("#0f8") == Colour(0, 255, 136)
    assert parse_background(Auto()) == Auto()
    cv2.imwrite(str(tmp_path / "empty.png"), np.full((4, 5, 3), 9, dtype=np.uint8))
    table = parse_background(str(tmp_path / "empty.png"))
    assert isinstance(table, EmptyTable)
    assert table.photo.shape == (4, 5, 3)
    for wrong in ("300,0,0", "99999999999,0,0", "1,2", "#12345", "grey", "", "no/such.png", "a\0b"):
        with pytest.raises(InvalidSettings, match="background: expected"):
            parse_background(wrong)
    with pytest.raises(InvalidImage):
        parse_background(str(tmp_path))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"threshold": -1}, "threshold: expected a number from 0"),
        ({"threshold": float("nan")}, "threshold: expected"),
        ({"kernel": 4}, "kernel: expected an odd"),
        ({"median": 0}, "median: expected an odd"),
        ({"rounds": -1}, "rounds: expected"),
        ({"decision": "both"}, "decision: expected"),
        ({"surface_sides": 0}, "surface_sides: expected"),
    ],
)
def test_settings_outside_their_domain(change: dict[str, float], message: str) -> None:
    with pytest.raises(InvalidSettings, match=message):
        ClothSettings(**change)  # type: ignore[arg-type]


def test_polygons() -> None:
    assert parse_polygon(" 0,0;10,0 ; 10,5 ") == ((0.0, 0.0), (10.0, 0.0), (10.0, 5.0))
    for wrong in ("", "1,2 3,4", "1,2 3,4 5", "1,2 3,4 a,b", "1,2 3,4 nan,0", "1,2 3,4 1e9,0"):
        with pytest.raises(InvalidSettings, match="roi"):
            parse_polygon(wrong)
    with pytest.raises(InvalidSettings, match="no pixel of the 4 x 3 image lies inside"):
        region([(50, 50), (60, 50), (60, 60)], (3, 4))
    assert region(None, (3, 4)).all()


def test_voids_are_black_bars_and_what_is_black_besides() -> None:
    photo, _ = picture(noise=0)
    photo[100:110, 100:110] = 0
    assert not void(photo).any(), "black cloth on a photo without bars"
    photo[:12] = 3
    assert void(photo)[5, 5]
    assert void(photo)[105, 105]
    assert (filled(photo, void(photo))[105, 105] == photo[120, 120]).all()
    assert not void(np.zeros((5, 5, 3), dtype=np.uint8)).any()


@pytest.mark.parametrize(
    "photo", [np.zeros((3, 3)), np.zeros((3, 3, 4), dtype=np.uint8), np.zeros((0, 3, 3), dtype=np.uint8)]
)
def test_arrays_that_are_no_photo(photo: NDArray[np.uint8]) -> None:
    with pytest.raises(InvalidImage, match="photo: expected"):
        rgb(photo)


@pytest.mark.parametrize(("step", "found"), [(30, True), (0, False)])
def test_a_garment_paler_than_the_threshold_is_found_where_distances_are_rare_in_between(step: int, found: bool) -> None:
    rng = np.random.default_rng(3)
    photo = np.full((120, 160, 3), 215, dtype=np.uint8)
    photo[40:80, 50:100, 0] -= np.uint8(step)
    noisy = np.clip(photo + rng.normal(0, 2, photo.shape), 0, 255).astype(np.uint8)
    seen = cloth_map(noisy)
    inside = seen.distance[45:75, 55:95]
    assert float(np.median(inside)) < 14, "paler than the usual threshold"
    assert bool(seen.cloth[60, 80]) is found
    assert not seen.cloth[10:20].any()
    assert (seen.threshold < 14) is found

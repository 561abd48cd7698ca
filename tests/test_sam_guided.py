"""Guided prompting over a model that needs no weights: it answers a point with the rectangles around it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings
from pscover.perception.guided import Guide, segment_guided
from pscover.perception.mask import Mask
from pscover.perception.promptable import Decoded, Frame
from pscover.perception.prompts import interior_points
from pscover.perception.proposals import Proposals, distinct, stability

pytest.importorskip("cv2")

RED, BLUE, GREY = (200, 30, 30), (30, 30, 200), (120, 120, 120)
HEIGHT, WIDTH = 120, 160
LEFT, RIGHT = (20, 30, 80, 80), (20, 80, 80, 130)
BOTH = (20, 30, 80, 130)


@dataclass(kw_only=True)
class Rectangles:
    """A model that knows rectangles (top, left, bottom, right) of the whole photo, with scores, and counts its points."""

    known: dict[tuple[int, int, int, int], float]
    corner: tuple[int, int] = (0, 0)
    frame: Frame = field(default_factory=lambda: Frame(height=HEIGHT, width=WIDTH, side=256))
    asked: list[tuple[float, float]] = field(default_factory=list)
    embeddings: int = 0

    def embed(self, photo: NDArray[np.uint8]) -> Rectangles:
        self.frame = Frame(height=photo.shape[0], width=photo.shape[1], side=256)
        self.embeddings += 1
        return self

    def decode(self, points: NDArray[np.float64]) -> Decoded:
        rows, columns = self.frame.cells
        wide, high = self.frame.cell
        x, y = (np.arange(columns) + 0.5) * wide + self.corner[1], (np.arange(rows) + 0.5) * high + self.corner[0]
        logits = np.full((len(points), 3, rows, columns), -9.0, dtype=np.float32)
        iou = np.zeros((len(points), 3), dtype=np.float32)
        for n, point in enumerate(points + np.array(self.corner[::-1])):
            self.asked.append((float(point[0]), float(point[1])))
            around = [box for box in self.known if box[0] <= point[1] < box[2] and box[1] <= point[0] < box[3]]
            for k, (top, left, bottom, right) in enumerate(around[:3]):
                inside = ((y >= top) & (y < bottom))[:, None] & ((x >= left) & (x < right))
                logits[n, k][inside] = 9
                iou[n, k] = self.known[top, left, bottom, right]
        return Decoded(logits=logits, iou=iou)


def scene(*garments: tuple[tuple[int, int, int, int], tuple[int, int, int]]) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    photo = np.full((HEIGHT, WIDTH, 3), GREY, dtype=np.uint8)
    cloth = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    for (top, left, bottom, right), colour in garments:
        photo[top:bottom, left:right] = colour
        cloth[top:bottom, left:right] = True
    return photo, cloth


def whole(margin: float = 1.0, **settings: float) -> Guide:
    """A guide that shows the model the whole photo, so that the rectangles need no shift."""
    return Guide(margin=margin, **settings)  # type: ignore[arg-type]


def iou(mask: Mask, box: tuple[int, int, int, int]) -> float:
    truth = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    truth[box[0] : box[2], box[1] : box[3]] = True
    pixels = mask.pixels((HEIGHT, WIDTH))
    return float(np.count_nonzero(pixels & truth) / np.count_nonzero(pixels | truth))


def test_every_garment_becomes_one_mask_for_a_few_prompts() -> None:
    photo, cloth = scene((LEFT, RED), (RIGHT, BLUE))
    model = Rectangles(known={LEFT: 0.99, RIGHT: 0.98})
    found = segment_guided(model, photo, cloth, whole())
    assert len(found.masks) == 2
    assert all(max(iou(mask, box) for mask in found.masks) > 0.9 for box in (LEFT, RIGHT))
    assert model.embeddings == 1
    assert len(model.asked) < 40
    assert {stage.name for stage in found.stages} == {"encoder", "decoder", "post-processing"}


def test_prompts_lie_on_cloth() -> None:
    photo, cloth = scene((LEFT, RED), (RIGHT, BLUE))
    model = Rectangles(known={LEFT: 0.99})
    segment_guided(model, photo, cloth, whole())
    assert all(cloth[round(y - 0.5), round(x - 0.5)] for x, y in model.asked)


def test_unions_and_parts_come_with_their_scores_for_the_clean_up_to_judge() -> None:
    photo, cloth = scene((LEFT, RED), (RIGHT, BLUE))
    masks = _masks(Rectangles(known={BOTH: 0.99, LEFT: 0.97, RIGHT: 0.96}), photo, cloth)
    assert sorted(round(mask.score, 2) for mask in masks) == [0.96, 0.97, 0.99]


def _masks(model: Rectangles, photo: NDArray[np.uint8], cloth: NDArray[np.bool_]) -> tuple[Mask, ...]:
    return segment_guided(model, photo, cloth, whole()).masks


@pytest.mark.parametrize("prompts", [1, 5, 11])
def test_the_budget_of_prompts_is_kept(prompts: int) -> None:
    photo, cloth = scene((BOTH, RED))
    model = Rectangles(known={})
    assert segment_guided(model, photo, cloth, whole(prompts=prompts)).masks == ()
    assert len(model.asked) == prompts


def test_where_no_good_mask_is_found_nobody_asks_twice() -> None:
    photo, cloth = scene((BOTH, RED))
    model = Rectangles(known={})
    segment_guided(model, photo, cloth, whole(prompts=10_000))
    assert len(model.asked) < 1000
    assert len(set(model.asked)) == len(model.asked)


def test_masks_of_low_quality_or_off_the_cloth_go() -> None:
    photo, cloth = scene((LEFT, RED))
    assert _masks(Rectangles(known={LEFT: 0.5}), photo, cloth) == ()
    assert _masks(Rectangles(known={(0, 0, HEIGHT, WIDTH): 0.99}), photo, cloth) == ()


def test_the_model_sees_the_cloth_and_a_margin_and_masks_come_back_to_the_photo() -> None:
    photo, cloth = scene((LEFT, RED))
    model = Rectangles(known={LEFT: 0.99}, corner=(8, 18))
    found = segment_guided(model, photo, cloth, Guide(margin=0.2))
    assert (model.frame.height, model.frame.width) == (84, 74)
    assert iou(found.masks[0], LEFT) > 0.9


def test_without_cloth_the_model_is_not_even_run() -> None:
    photo, cloth = scene()
    model = Rectangles(known={})
    assert segment_guided(model, photo, cloth, whole()).masks == ()
    assert model.embeddings == 0


def test_one_pixel_of_cloth_is_no_trouble() -> None:
    photo, cloth = scene()
    cloth[3, 5] = True
    assert segment_guided(Rectangles(known={}), photo, cloth, Guide()).masks == ()


def test_wrong_shapes_and_types_are_refused() -> None:
    photo, cloth = scene((LEFT, RED))
    model = Rectangles(known={})
    with pytest.raises(InvalidImage, match=r"photo: expected shape \(H, W, 3\) of uint8, got .* float64"):
        segment_guided(model, photo.astype(np.float64), cloth, Guide())
    with pytest.raises(InvalidImage, match=r"cloth map: expected shape \(120, 160\) of bool, got \(119, 160\)"):
        segment_guided(model, photo, cloth[1:], Guide())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"prompts": 0}, "prompts: expected at least 1, got 0"),
        ({"covered": 1.5}, "covered: expected a share"),
        ({"min_iou": float("nan")}, "min_iou: expected a share"),
        ({"alike": 0.0}, "alike: expected a positive distance"),
    ],
)
def test_settings_are_checked(settings: dict[str, float], message: str) -> None:
    with pytest.raises(InvalidSettings, match=message):
        Guide(**settings)  # type: ignore[arg-type]


@pytest.mark.parametrize(("height", "width"), [(424, 512), (480, 640), (97, 1023), (1, 1), (3000, 200)])
def test_a_shape_survives_the_way_to_cells_and_back(height: int, width: int) -> None:
    frame = Frame(height=height, width=width)
    truth = np.zeros((height, width), dtype=np.bool_)
    truth[height // 4 : height // 4 + max(1, height // 2), width // 4 : width // 4 + max(1, width // 2)] = True
    logits = (frame.shrink(truth) - 0.5) * 10
    (mask,) = Proposals(logits=logits[None], score=np.ones(1, dtype=np.float32)).enlarged(frame)
    back = mask.pixels((height, width))
    assert np.count_nonzero(back & truth) >= 0.9 * np.count_nonzero(back | truth)


def test_cells_and_points_agree() -> None:
    frame = Frame(height=480, width=640)
    cells = np.array([[0.0, 0.0], [191.0, 255.0]])
    assert frame.in_photo(cells).tolist() == [[1.25, 1.25], [638.75, 478.75]]
    assert frame.in_square(frame.in_photo(cells)).tolist() == [[2.0, 2.0], [1022.0, 766.0]]


def test_points_keep_their_distance() -> None:
    points = interior_points(np.ones((40, 60), dtype=np.bool_), 50, 8.0, 2.0)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + 99 * np.eye(len(points))
    assert len(points) > 4
    assert apart.min() > 2


def test_non_maximum_suppression_is_empty_for_nothing() -> None:
    assert distinct(np.zeros((0, 3, 4), dtype=np.bool_), np.zeros(0, dtype=np.float32), 0.5).tolist() == []
    assert stability(np.zeros((0, 3, 4), dtype=np.float32)).tolist() == []

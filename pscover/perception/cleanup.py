"""From masks to one label a pixel (paper, section 3), for every segmenter.

The rules, in order:

1.  A mask is cut to the cloth. One with more than `off_cloth` of its pixels off the cloth is of the surface and goes.
2.  Where masks come with scores (any below 1), one that is worth less than the masks inside it goes: it shows several
    garments (`pscover.perception.unions`).
3.  A *group* goes: a mask of which at least two smaller, disjoint masks of different colours cover `group_cover`.
    It shows a heap rather than a garment.
4.  Largest first, a mask that lies in a larger kept one by at least `redundant` of its pixels goes (the paper's glove and
    fingers), unless it is at least `part_share` of it and of another colour: then the larger one shows two garments.
5.  What is left is painted largest first: where masks overlap, the smaller one is on top. Pieces of one mask that others cut
    apart keep one label.
6.  Cloth that no mask covers goes to the nearest label within `gap`; what is farther away becomes segments of its own, told
    apart by colour (`pscover.perception.shades`).
7.  A connected piece of a label below `min_segment_area` is a fragment: it goes to the neighbour that it touches along most
    pixel edges. Fragments that touch no segment become one segment if together they are large enough, and surface
    if not. So every connected piece of cloth of at least `min_segment_area` is labelled to its last pixel.
8.  Labels are numbered from 1 by decreasing area.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings
from pscover.perception.colour import FloatImage
from pscover.perception.mask import Mask
from pscover.perception.regions import absorb, pieces, renumbered, sizes
from pscover.perception.shades import by_colour
from pscover.perception.unions import without_unions

BoolImage = NDArray[np.bool_]
LabelImage = NDArray[np.int32]
LIGHTNESS = 0.5
"""Weight of L where colours of masks are compared."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CleanUp:
    """Settings of the clean-up; the module says what each rule does. Areas are in pixels of the image.

    Parameters
    ----------
    min_segment_area
        A piece of fewer pixels is a fragment; it is never a segment. (SAM's `min_mask_region_area` is another thing.)
    off_cloth
        Share of a mask off the cloth above which it is of the surface.
    redundant
        Share of a mask inside a larger one from which it is redundant.
    group_cover
        Share of a mask that smaller ones must cover for it to be a group.
    part_share
        Share of the larger mask from which a nested one of another colour is a garment of its own.
    contrast
        Distance of median colours (Lab, half the weight on L) from which two masks are of different colours.
    gap
        Uncovered cloth this near to a label (pixels) belongs to it.

    Raises
    ------
    InvalidSettings
        If a setting is outside its domain.
    """

    min_segment_area: int = 400
    off_cloth: float = 0.5
    redundant: float = 0.85
    group_cover: float = 0.8
    part_share: float = 0.2
    contrast: float = 16.0
    gap: int = 4

    def __post_init__(self) -> None:
        for name, value, highest in (
            ("min_segment_area", self.min_segment_area, 1e9), ("off_cloth", self.off_cloth, 1),
            ("redundant", self.redundant, 1), ("group_cover", self.group_cover, 1),
            ("part_share", self.part_share, 1), ("contrast", self.contrast, 1000), ("gap", self.gap, 1000),
        ):  # fmt: skip
            if not (math.isfinite(value) and 0 <= value <= highest):
                raise InvalidSettings(f"{name}: expected a number from 0 to {highest:g}, got {value!r}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Labels:
    """One label a pixel.

    Parameters
    ----------
    image
        0 is the surface, garments are numbered from 1 by decreasing area, shape (H, W), read-only.
    names
        What the segmenter called each garment, or "".
    scores
        How sure the segmenter was of each, in [0, 1]; 0 for cloth that no mask covered.
    """

    image: LabelImage
    names: tuple[str, ...]
    scores: tuple[float, ...]


def to_labels(
    masks: Sequence[Mask], cloth: BoolImage, settings: CleanUp | None = None, *, image: FloatImage | None = None
) -> Labels:
    """One label a pixel from masks that overlap, nest and leave gaps; smaller masks lie on top.

    Parameters
    ----------
    masks
        In any order; the result depends on it only between masks of equal area and score. A score of 1 says nothing.
    cloth
        Which pixels show cloth, shape (H, W). No other pixel gets a label.
    settings
        Thresholds of the rules.
    image
        Lab of the photo, shape (H, W, 3). Without it all masks count as of one colour: no group is found, and
        every nested mask is redundant.

    Raises
    ------
    InvalidImage
        If a mask reaches beyond the image.

    Examples
    --------
    >>> cloth = np.ones((20, 30), dtype=bool)
    >>> left, inner, right = (np.zeros((20, 30)) for _ in range(3))
    >>> left[:, :15], inner[5:10, 5:10], right[:, 14:] = 1, 1, 1
    >>> result = to_labels([Mask.of(left), Mask.of(inner), Mask.of(right)], cloth, CleanUp(min_segment_area=20))
    >>> np.bincount(result.image.ravel()).tolist()
    [0, 300, 300]
    """
    using = settings or CleanUp()
    kept = _kept(_on_cloth(masks, cloth, using), (cloth.shape[0], cloth.shape[1]), using, image)
    painted = np.zeros(cloth.shape, dtype=np.int32)
    for number, mask in enumerate(kept, start=1):
        painted[mask.window][mask.bits] = number
    whole = _without_fragments(_with_uncovered(painted, cloth, using, len(kept), image), using)
    labels, origin = renumbered(whole)
    labels.setflags(write=False)
    sources = [kept[old - 1] if old <= len(kept) else None for old in origin.tolist()]
    return Labels(
        image=labels,
        names=tuple("" if source is None else source.name for source in sources),
        scores=tuple(0.0 if source is None else source.score for source in sources),
    )


def _on_cloth(masks: Sequence[Mask], cloth: BoolImage, settings: CleanUp) -> list[Mask]:
    """The masks cut to the cloth, without those of the surface, largest first."""
    height, width = cloth.shape
    cut = []
    for k, mask in enumerate(masks):
        tall, wide = mask.bits.shape
        if mask.top < 0 or mask.left < 0 or mask.top + tall > height or mask.left + wide > width:
            raise InvalidImage(
                f"mask {k}: expected a mask inside the {width} x {height} image, got {wide} x {tall} pixels at "
                f"x={mask.left}, y={mask.top}"
            )
        bits = mask.bits & cloth[mask.window]
        area, before = np.count_nonzero(bits), mask.area
        if area < max(1, settings.min_segment_area):
            # It could only be a fragment; what it covers falls to its surroundings.
            continue
        if area >= (1 - settings.off_cloth) * before:
            cut.append(Mask(top=mask.top, left=mask.left, bits=bits, score=mask.score, name=mask.name))
    return sorted(cut, key=lambda mask: (-mask.area, -mask.score))


def _kept(masks: list[Mask], shape: tuple[int, int], settings: CleanUp, image: FloatImage | None) -> list[Mask]:
    """Rules 2 to 4: no unions, groups or redundant masks, largest first."""
    if any(mask.score < 1 for mask in masks):
        masks = without_unions(masks, shape, image)
    kept: list[Mask] = []
    for k, mask in enumerate(masks):
        if image is not None and _is_group(mask, masks[k + 1 :], settings, image):
            continue
        if not any(_is_redundant(mask, larger, settings, image) for larger in kept):
            kept.append(mask)
    return kept


def _is_group(mask: Mask, smaller: list[Mask], settings: CleanUp, image: FloatImage) -> bool:
    """Whether smaller, disjoint masks of different colours cover most of a mask."""
    area = mask.area
    covered = np.zeros(mask.bits.shape, dtype=np.bool_)
    colours = []
    for other in smaller:
        size = other.area
        if size > settings.redundant * area or overlap(other, mask) < settings.redundant * size:
            continue
        inner = other.pixels(image.shape[:2])[mask.window]
        if np.count_nonzero(inner & covered) <= (1 - settings.redundant) * size:
            covered |= inner
            colours.append(_colour(image[mask.window], inner))
    if np.count_nonzero(covered & mask.bits) < settings.group_cover * area:
        return False
    return any(_distance(a, b) > settings.contrast for k, a in enumerate(colours) for b in colours[:k])


def _is_redundant(mask: Mask, larger: Mask, settings: CleanUp, image: FloatImage | None) -> bool:
    area = mask.area
    if overlap(mask, larger) < settings.redundant * area:
        return False
    if image is None or area < settings.part_share * larger.area:
        return True
    inner = mask.pixels(image.shape[:2])[larger.window] & larger.bits
    outer = larger.bits & ~inner
    if np.count_nonzero(outer) < settings.part_share * larger.area:
        return True
    view = image[larger.window]
    return _distance(_colour(view, inner), _colour(view, outer)) <= settings.contrast


def overlap(one: Mask, two: Mask) -> int:
    """Pixels that two masks share.

    Examples
    --------
    >>> overlap(Mask.of([[1, 1, 0]]), Mask.of([[0, 1, 1]]))
    1
    """
    (rows, columns), (rows2, columns2) = one.window, two.window
    top, bottom = max(rows.start, rows2.start), min(rows.stop, rows2.stop)
    left, right = max(columns.start, columns2.start), min(columns.stop, columns2.stop)
    if top >= bottom or left >= right:
        return 0
    first = one.bits[top - one.top : bottom - one.top, left - one.left : right - one.left]
    second = two.bits[top - two.top : bottom - two.top, left - two.left : right - two.left]
    return int(np.count_nonzero(first & second))


def _colour(image: FloatImage, bits: BoolImage) -> NDArray[np.float32]:
    return np.asarray(np.median(image[bits], axis=0) * np.array([LIGHTNESS, 1, 1], dtype=np.float32))


def _distance(one: NDArray[np.float32], two: NDArray[np.float32]) -> float:
    return float(np.linalg.norm(one - two))


def _with_uncovered(
    painted: LabelImage, cloth: BoolImage, settings: CleanUp, masks: int, image: FloatImage | None
) -> LabelImage:
    """Rule 6; new labels start above the number of masks."""
    free = cloth & (painted == 0)
    if not free.any():
        return painted
    if not painted.any():
        islands = _islands(free, settings, image)
        return np.where(islands > 0, islands + masks, 0).astype(np.int32)
    from scipy.ndimage import distance_transform_edt

    away, (rows, columns) = distance_transform_edt(painted == 0, return_indices=True)
    rim = free & (away <= settings.gap)
    islands = _islands(free & ~rim, settings, image)
    labelled = np.where(islands > 0, islands + masks, painted)
    return np.where(rim, painted[rows, columns], labelled).astype(np.int32)


def _islands(free: BoolImage, settings: CleanUp, image: FloatImage | None) -> LabelImage:
    """Connected pieces of uncovered cloth; where they are large enough for it and there is an image, by colour."""
    islands = pieces(free.astype(np.int32))
    large = sizes(islands) >= max(1, 2 * settings.min_segment_area)
    large[0] = False
    if image is None or not large.any():
        return islands
    parts = by_colour(image, large[islands])
    return np.where(parts > 0, parts + int(islands.max()), islands).astype(np.int32)


def _without_fragments(labels: LabelImage, settings: CleanUp) -> LabelImage:
    """Rule 7."""
    parts = pieces(labels)
    area = sizes(parts)
    owner = np.zeros(len(area), dtype=np.int32)
    owner[parts.ravel()] = labels.ravel()
    fragment = area < settings.min_segment_area
    fragment[0] = False
    owner[0] = 0
    settled = owner[absorb(parts, fragment)]
    loose = pieces(((labels > 0) & (settled == 0)).astype(np.int32))
    together = sizes(loose) >= settings.min_segment_area
    together[0] = False
    highest = int(labels.max(initial=0))
    return np.where(together[loose], loose + highest, settled).astype(np.int32)

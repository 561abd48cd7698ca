"""Random scenes of garments on a surface, for experiments that need many or exactly known ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from pscover.errors import InvalidSettings
from pscover.generate.outlines import Mask, Outline
from pscover.image_parts import PIXEL_LIMIT
from pscover.scene import Scene

Layout = Literal["apart", "piled"]

SMALLEST, LARGEST = 400.0, 3000.0
"""Visible area of a garment that lies free, in pixels."""
GAP = 4
"""Pixels of surface between garments that lie apart."""
VISIBLE = 100
"""Pixels of each garment that must stay visible in a pile."""
TRIALS = 60
"""Random places tried at each size before the garment is made smaller by `SHRINK`."""
SHRINK = 0.85
STEPS = 40
"""How often a group or a pile is tried anew, further out and with smaller garments, before giving up."""
AVERAGE = 1300
"""Pixels of an average garment."""


def garments(
    count: int,
    seed: int = 0,
    *,
    size: tuple[int, int] = (282, 470),
    layout: Layout = "apart",
    groups: Sequence[int] = (),
) -> Scene:
    """A random scene of t-shirts, shorts, socks, scarves, towels, underwear and crumpled heaps.

    Areas are log-uniform from 400 to 3000 pixels. A garment that finds no place in 60 random trials is made smaller, down
    to 400 pixels; then every place is looked at. Garment i depends on the seed, on i and on those before it only, so that
    `garments(10, seed)` is `garments(5, seed)` with five more (the series of the paper's Table 2).

    Parameters
    ----------
    count
        How many garments.
    seed
        Of everything random.
    size
        Height and width in pixels; the paper's workspace of 0.6 m x 1.0 m by default.
    layout
        "apart": with at least 4 pixels of surface between any two. "piled": dropped over each other around the middle,
        with at least 100 pixels of each still visible.
    groups
        With "apart": sizes of groups of overlapping garments, in which any two overlap (before one hides the other) and at
        least 100 pixels of each are visible. Groups keep apart from each other and from the rest (the paper's third
        experiment).

    Returns
    -------
    Scene
        Labels 1 to `count` in the order of placing.

    Raises
    ------
    InvalidSettings
        If a number is outside its domain, or the garments find no place.

    Examples
    --------
    >>> scene = garments(5, seed=0)
    >>> scene.garments, scene.shape, scene.names[0]
    (5, (282, 470), 'underwear 1')
    >>> bool((garments(10, seed=0).labels[scene.labels > 0] == scene.labels[scene.labels > 0]).all())
    True
    """
    _check(count, size, layout, groups)
    floor = _Floor(np.zeros(size, dtype=np.int32))
    member_of = np.repeat(np.arange(len(groups)), groups)
    for i in range(count):
        generator = np.random.default_rng([seed, i])
        outline = Outline.random(generator)
        area = float(np.exp(generator.uniform(np.log(SMALLEST), np.log(LARGEST))))
        if layout == "piled":
            floor.pile(outline, area, generator)
        elif i < len(member_of):
            floor.join(outline, area, generator, group=np.flatnonzero(member_of[:i] == member_of[i]) + 1)
        else:
            floor.lay(outline, area, generator)
    gathered = f", groups={tuple(groups)}" if groups else ""
    return Scene.of(
        floor.labels,
        names=[f"{kind} {i + 1}" for i, kind in enumerate(floor.kinds)],
        source=f"garments({count}, seed={seed}, size={tuple(size)}, layout={layout!r}{gathered})",
    )


def _check(count: int, size: tuple[int, int], layout: str, groups: Sequence[int]) -> None:
    if count < 0:
        raise InvalidSettings(f"count: expected a whole number of at least 0, got {count!r}")
    if len(size) != 2 or min(size) < 1:
        raise InvalidSettings(f"size: expected (height, width) in pixels, got {size!r}")
    if size[0] * size[1] > PIXEL_LIMIT:
        raise InvalidSettings(
            f"size: expected at most {PIXEL_LIMIT} pixels, got height {size[0]} x width {size[1]} = {size[0] * size[1]}; "
            "choose a smaller height or width"
        )
    if layout not in ("apart", "piled"):
        raise InvalidSettings(f"layout: expected 'apart' or 'piled', got {layout!r}")
    if groups and (layout != "apart" or min(groups) < 2 or sum(groups) > count):
        raise InvalidSettings(
            f"groups: expected sizes of at least 2 that sum to at most {count}, with layout 'apart', "
            f"got {tuple(groups)} with layout {layout!r}"
        )


@dataclass(slots=True)
class _Floor:
    """The surface while garments are put on it."""

    labels: NDArray[np.int32]
    kinds: list[str] = field(default_factory=list)
    whole: list[tuple[int, int, Mask]] = field(default_factory=list)
    """Top, left and mask of each garment, hidden pixels included."""
    visible: list[int] = field(default_factory=list)

    def lay(self, outline: Outline, area: float, generator: np.random.Generator) -> None:
        """Put a garment where nothing lies near."""
        smaller = area
        while True:
            mask = outline.mask(smaller)
            for _ in range(TRIALS):
                at = self._anywhere(mask, generator)
                if at is not None and not self._near(*at, mask).any():
                    return self._put(*at, mask, outline.kind)
            if smaller <= SMALLEST:
                break
            smaller = max(SMALLEST, smaller * SHRINK)
        free = self._free(mask)
        if len(free) == 0:
            raise self._no_place()
        top, left = free[generator.integers(len(free))]
        return self._put(int(top), int(left), mask, outline.kind)

    def join(self, outline: Outline, area: float, generator: np.random.Generator, group: NDArray[np.intp]) -> None:
        """Put a garment over all those of a group (labels) and near no other; the first of a group lies free."""
        if len(group) == 0:
            return self.lay(outline, area, generator)
        middle = np.mean([self._middle(int(label)) for label in group], axis=0)
        for step in range(STEPS):
            mask = outline.mask(max(SMALLEST, area * SHRINK**step))
            for _ in range(TRIALS):
                at = self._around(mask, middle, 12.0 + 3 * step, generator)
                if at is None or np.setdiff1d(self._near(*at, mask), group).any():
                    continue
                if all(self._overlaps(*at, mask, int(label)) for label in group) and self._leaves_visible(*at, mask):
                    return self._put(*at, mask, outline.kind)
        raise self._no_place()

    def pile(self, outline: Outline, area: float, generator: np.random.Generator) -> None:
        """Drop a garment around the middle, further out the longer no place is found."""
        middle = np.array(self.labels.shape) / 2
        narrow, wide = 0.35 * math.sqrt(AVERAGE * (len(self.kinds) + 1) / math.pi), middle.min()
        for step in range(STEPS):
            mask = outline.mask(max(SMALLEST, area * SHRINK ** (step // 4)))
            spread = narrow + (wide - narrow) * max(0.0, (step - 4) / STEPS)
            for _ in range(TRIALS):
                at = self._around(mask, middle, spread, generator)
                if at is not None and self._leaves_visible(*at, mask):
                    return self._put(*at, mask, outline.kind)
        raise self._no_place()

    def _put(self, top: int, left: int, mask: Mask, kind: str) -> None:
        for label, count in self._hidden(top, left, mask):
            self.visible[label - 1] -= count
        self.kinds.append(kind)
        self.whole.append((top, left, mask))
        self.visible.append(int(mask.sum()))
        self.labels[top : top + mask.shape[0], left : left + mask.shape[1]][mask] = len(self.kinds)

    def _anywhere(self, mask: Mask, generator: np.random.Generator) -> tuple[int, int] | None:
        room = np.subtract(self.labels.shape, mask.shape)
        if (room < 0).any():
            return None
        return int(generator.integers(room[0] + 1)), int(generator.integers(room[1] + 1))

    def _around(
        self, mask: Mask, middle: NDArray[np.float64], spread: float, generator: np.random.Generator
    ) -> tuple[int, int] | None:
        room = np.subtract(self.labels.shape, mask.shape)
        top, left = np.round(generator.normal(middle, spread) - np.array(mask.shape) / 2).astype(int)
        return (int(top), int(left)) if 0 <= top <= room[0] and 0 <= left <= room[1] else None

    def _middle(self, label: int) -> NDArray[np.float64]:
        top, left, mask = self.whole[label - 1]
        return np.array([top + mask.shape[0] / 2, left + mask.shape[1] / 2])

    def _near(self, top: int, left: int, mask: Mask) -> NDArray[np.int32]:
        """Labels of what lies within the gap (a square around each pixel) of a garment put there."""
        wide = _widened(mask)
        height, width = self.labels.shape
        first, last = max(0, top - GAP), min(height, top + mask.shape[0] + GAP)
        begin, end = max(0, left - GAP), min(width, left + mask.shape[1] + GAP)
        part = wide[first - top + GAP : last - top + GAP, begin - left + GAP : end - left + GAP]
        found = self.labels[first:last, begin:end][part]
        return np.unique(found[found > 0])

    def _free(self, mask: Mask) -> NDArray[np.intp]:
        """Every (top, left) at which nothing lies near."""
        wide = _widened(mask)
        taken = np.pad(self.labels > 0, GAP).astype(np.float32)
        if min(np.subtract(taken.shape, wide.shape)) < 0:
            return np.zeros((0, 2), dtype=np.intp)
        return np.argwhere(oaconvolve(taken, wide[::-1, ::-1].astype(np.float32), mode="valid") < 0.5)

    def _overlaps(self, top: int, left: int, mask: Mask, label: int) -> bool:
        above, before, other = self.whole[label - 1]
        first, last = max(top, above), min(top + mask.shape[0], above + other.shape[0])
        begin, end = max(left, before), min(left + mask.shape[1], before + other.shape[1])
        if first >= last or begin >= end:
            return False
        mine = mask[first - top : last - top, begin - left : end - left]
        return bool((mine & other[first - above : last - above, begin - before : end - before]).any())

    def _leaves_visible(self, top: int, left: int, mask: Mask) -> bool:
        return all(self.visible[label - 1] - count >= VISIBLE for label, count in self._hidden(top, left, mask))

    def _hidden(self, top: int, left: int, mask: Mask) -> Iterator[tuple[int, int]]:
        """Labels, and how many of their visible pixels a garment put there would hide."""
        under = self.labels[top : top + mask.shape[0], left : left + mask.shape[1]][mask]
        labels, counts = np.unique(under[under > 0], return_counts=True)
        return zip(labels.tolist(), counts.tolist(), strict=True)

    def _no_place(self) -> InvalidSettings:
        height, width = self.labels.shape
        return InvalidSettings(
            f"garment {len(self.kinds) + 1} finds no place on {width} x {height} pixels with {len(self.kinds)} garments on "
            "it; use a larger size, fewer garments or another seed"
        )


def _widened(mask: Mask) -> Mask:
    """The mask and all within `GAP` pixels of it along both axes, on a grid that is larger by as much on each side."""
    wide = np.pad(mask, GAP)
    for axis in (0, 1):
        spread = wide.copy()
        for step in range(1, GAP + 1):
            spread |= np.roll(wide, step, axis) | np.roll(wide, -step, axis)
        wide = spread
    return wide

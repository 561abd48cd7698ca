"""Guided prompting: a promptable model asked only about cloth, and only until the cloth is explained.

The published mask generator (Kirillov et al. 2023, appendix B) prompts a grid of 32 x 32 points over the whole photo,
enlarges every mask and thins them out last. Here prompts go where the cloth map is true and no good mask lies yet, in small
batches, widest places first; masks are judged and thinned out at low resolution, and only survivors are enlarged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from pscover.errors import InvalidSettings
from pscover.perception.colour import lab, opencv
from pscover.perception.promptable import Decoded, Embedded, FloatArray, Frame, Promptable, checked
from pscover.perception.prompts import interior_points
from pscover.perception.proposals import Proposals, areas, distinct, stability
from pscover.perception.segmenter import Segmentation
from pscover.perception.stopwatch import Stopwatch

RIM = 2
"""Cells over which the blur of colours reaches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Guide:
    """How to prompt and what to keep.

    Parameters
    ----------
    prompts
        The most points a photo is asked about.
    batch
        Points decoded at a time. Between batches the map of what is explained is brought up to date.
    covered
        Stop when this share of the cloth is explained.
    reach
        A prompt explains nothing farther away than this share of the photo's longer side.
    alike
        A prompt explains only what has the colour around it, within this distance in CIE Lab, lightness counted half.
    thinnest
        Cloth narrower than twice this share of the photo's longer side gets no prompt.
    min_iou
        A mask must have at least this quality, by the model's own guess.
    min_stability
        A mask must be at least this stable; see `pscover.perception.proposals.stability`.
    max_overlap
        Of two masks with a greater intersection over union the worse one is dropped.
    on_cloth
        At least this share of a mask must be cloth.
    margin
        The model is shown the cloth's bounding box and around it this share of the box's longer side: what lies beyond costs
        resolution.
    """

    prompts: int = 96
    batch: int = 4
    covered: float = 0.97
    reach: float = 0.12
    alike: float = 20.0
    thinnest: float = 0.008
    min_iou: float = 0.86
    min_stability: float = 0.9
    max_overlap: float = 0.75
    on_cloth: float = 0.6
    margin: float = 0.15

    def __post_init__(self) -> None:
        for name in ("prompts", "batch"):
            if getattr(self, name) < 1:
                raise InvalidSettings(f"{name}: expected at least 1, got {getattr(self, name)}")
        if not 0 < self.alike < math.inf:
            raise InvalidSettings(f"alike: expected a positive distance, got {self.alike}")
        for name in ("covered", "reach", "thinnest", "min_iou", "min_stability", "max_overlap", "on_cloth", "margin"):
            if not 0 <= getattr(self, name) <= 1:
                raise InvalidSettings(f"{name}: expected a share from 0 to 1, got {getattr(self, name)}")


def segment_guided(model: Promptable, photo: NDArray[np.uint8], cloth: NDArray[np.bool_], guide: Guide) -> Segmentation:
    """Masks of the garments, also of their parts and of several as one, with their scores: the clean-up tells them apart.

    The stages are "encoder", "decoder" and "post-processing".

    Parameters
    ----------
    model
        Any promptable model.
    photo
        RGB, shape (H, W, 3).
    cloth
        Which pixels show cloth, shape (H, W).
    guide
        How to prompt and what to keep.

    Raises
    ------
    InvalidImage
        If photo or cloth map have the wrong shape or type.
    """
    photo, cloth = checked(photo, cloth)
    watch = Stopwatch()
    if not cloth.any():
        return Segmentation(masks=(), stages=watch.stages)
    part = _around(cloth, guide.margin)
    photo, cloth = np.ascontiguousarray(photo[part]), cloth[part]
    with watch.stage("encoder"):
        embedded = model.embed(photo)
    with watch.stage("post-processing"):
        colour = cell_colours(photo, embedded.frame)
    found = Search(embedded, cloth, colour, guide, watch).run()
    with watch.stage("post-processing"):
        found = found[distinct(found.inside(), found.score, guide.max_overlap)]
        masks = tuple(
            replace(mask, top=mask.top + part[0].start, left=mask.left + part[1].start)
            for mask in found.enlarged(embedded.frame)
        )
    return Segmentation(masks=masks, stages=watch.stages)


def _around(cloth: NDArray[np.bool_], margin: float) -> tuple[slice, slice]:
    """The bounding box of the cloth with a margin, cut to the photo."""
    rows, columns = (np.flatnonzero(cloth.any(axis=axis)) for axis in (1, 0))
    pad = round(margin * (1 + max(rows[-1] - rows[0], columns[-1] - columns[0])))
    top, bottom = max(0, rows[0] - pad), min(cloth.shape[0], rows[-1] + pad + 1)
    left, right = max(0, columns[0] - pad), min(cloth.shape[1], columns[-1] + pad + 1)
    return slice(int(top), int(bottom)), slice(int(left), int(right))


class Search:
    """One photo's prompts: what has been found and what is still to be explained.

    Parameters
    ----------
    embedded
        The photo, as the model has seen it.
    cloth
        Which pixels show cloth, shape (H, W).
    colour
        Of each cell, as `cell_colours` gives them.
    guide
        How to prompt and what to keep.
    watch
        Takes the times.
    """

    def __init__(
        self, embedded: Embedded, cloth: NDArray[np.bool_], colour: FloatArray, guide: Guide, watch: Stopwatch
    ) -> None:
        self.embedded, self.colour, self.guide, self.watch = embedded, colour, guide, watch
        self.share = embedded.frame.shrink(cloth)
        self.cloth = self.share >= 0.5
        self.unexplained = self.cloth.copy()
        self.asked = 0
        longer = max(embedded.frame.cells)
        self.reach, self.thinnest = guide.reach * longer, max(1.0, guide.thinnest * longer)
        # A point that found no good mask must not be asked about again.
        self.blind = 2 * self.thinnest

    def run(self) -> Proposals:
        """Prompt until the cloth is explained, the budget is spent or nothing is left that is wide enough."""
        found = Proposals.none(self.embedded.frame)
        while self.asked < self.guide.prompts and self._open():
            count = min(self.guide.batch, self.guide.prompts - self.asked)
            with self.watch.stage("post-processing"):
                cells = interior_points(self.unexplained, count, self.reach, self.thinnest)
            if len(cells) == 0:
                break
            found += self._ask(cells)
        return found

    def _open(self) -> bool:
        return bool(np.count_nonzero(self.unexplained) > (1 - self.guide.covered) * np.count_nonzero(self.cloth))

    def _ask(self, cells: NDArray[np.intp]) -> Proposals:
        with self.watch.stage("decoder"):
            decoded = self.embedded.decode(self.embedded.frame.in_photo(cells.astype(np.float64)))
        self.asked += len(cells)
        with self.watch.stage("post-processing"):
            good, owner = self._good(decoded)
            self._explain(cells, good.inside(), owner)
        return good

    def _good(self, decoded: Decoded) -> tuple[Proposals, NDArray[np.intp]]:
        """The masks worth keeping, and which point each came from."""
        n, k = decoded.iou.shape
        owner = np.repeat(np.arange(n), k)
        flat = Proposals(logits=decoded.logits.reshape(n * k, *decoded.logits.shape[2:]), score=decoded.iou.ravel())
        promising = flat.score >= self.guide.min_iou
        flat, owner = flat[promising], owner[promising]
        inside = flat.inside()
        size = areas(inside)
        on_cloth = np.tensordot(inside, self.share, axes=2) >= self.guide.on_cloth * np.maximum(size, 1)
        good = on_cloth & (size > 0) & (stability(flat.logits) >= self.guide.min_stability)
        return flat[good], owner[good]

    def _explain(self, cells: NDArray[np.intp], inside: NDArray[np.bool_], owner: NDArray[np.intp]) -> None:
        """Take from the unexplained what each point explains.

        That is the smallest good mask around it, for a larger one may be several garments; of that mask what lies within
        reach and has the colour around the point, for even the smallest may be a whole pile.
        """
        size = areas(inside)
        for point, (row, column) in enumerate(cells):
            self.unexplained[_disc(self.cloth.shape, row, column, self.blind)] = False
            around = np.flatnonzero((owner == point) & inside[:, row, column])
            if len(around):
                smallest = inside[around[size[around].argmin()]]
                alike = np.linalg.norm(self.colour - self.colour[row, column], axis=2) <= self.guide.alike
                # At a garment's rim the cells' colours are blurred with its neighbour's.
                alike = binary_dilation(alike, iterations=RIM)
                self.unexplained &= ~(smallest & alike & _disc(self.cloth.shape, row, column, self.reach))


def cell_colours(photo: NDArray[np.uint8], frame: Frame) -> FloatArray:
    """CIE Lab of each cell, blurred by a cell and a half, lightness halved: folds shade a cloth, they do not dye it."""
    rows, columns = frame.cells
    cv2 = opencv("segmenting with SAM")
    small = cv2.resize(photo, (columns, rows), interpolation=cv2.INTER_AREA)
    blurred = cv2.GaussianBlur(lab(small), (0, 0), 1.5)
    return np.asarray(blurred * np.array([0.5, 1, 1], dtype=np.float32), dtype=np.float32)


def _disc(shape: tuple[int, ...], row: int, column: int, radius: float) -> NDArray[np.bool_]:
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    return np.asarray((rows - row) ** 2 + (columns - column) ** 2 <= radius**2, dtype=np.bool_)

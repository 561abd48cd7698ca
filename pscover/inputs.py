"""From a file of any kind to what it shows: a photo, a label image, or masks made elsewhere. The content says which."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pscover.errors import InvalidImage
from pscover.files import opened
from pscover.images import BYTE_LIMIT, JPEG_SIGNATURE, PNG_SIGNATURE, read_labels, read_photo
from pscover.perception.annotations import format_of, read_annotations
from pscover.perception.background import Background
from pscover.perception.cleanup import to_labels
from pscover.perception.connectors.contract import Annotations
from pscover.perception.connectors.label_png import painted
from pscover.perception.depth import Depth, HeightMap
from pscover.perception.grid import PAPER_PIXELS_PER_CM, Grid
from pscover.perception.mask import Mask
from pscover.perception.perceive import Perception, Settings, perceive
from pscover.perception.roi import Polygon
from pscover.perception.segmenter import Segmentation, Segmenter
from pscover.perception.stopwatch import Stopwatch
from pscover.scene import Scene
from pscover.seen import Seen

HEAD = 26
ANNOTATION_STARTS = (b"{", b"[", b"\x93NUMPY", b"PK")
GREY, PALETTE, WHOLE_BYTES = 0, 3, 8
"""Colour types of PNG whose values may be labels, and the fewest bits that labels have."""
FEW, SMALL, WINDOW = 64, 32.0, 512
"""Values are a photo's if they lie in more than so many pieces of fewer pixels each, within a window of this side in the
middle: those of photos have 6 pixels at most, also of smooth ones, those of segmentations hundreds."""
DepthLike = Depth | str | PathLike[str] | ArrayLike
GENERATED = frozenset({"sam-records", "sam-folder"})
"""Formats of generators that mask everything in sight, the surface too."""
SURFACE_SHARE, SURFACE_SIDES, LARGEST_SHARE = 0.2, 3, 0.4
"""Without a photo, a mask of such a format is the surface if it has more than the first share of the image and touches so
many of its sides, or if it has more than the last share."""


class Kind(StrEnum):
    """What a file can be."""

    PHOTO = "photo"
    LABELS = "labels"
    ANNOTATIONS = "annotations"
    FOLDER = "folder"


def kind_of(path: str | PathLike[str]) -> Kind:
    """What a file, or folder, is; its name does not matter.

    A JPEG and a PNG in colour are photos. A PNG in grey or with a palette holds labels, unless its values change every few
    pixels like those of a photo. A folder with `metadata.csv` is what Segment Anything's script writes; others are
    folders of files. JSON and NumPy's files are annotations.

    Raises
    ------
    InvalidImage
        If it cannot be read, or is nothing of these.
    """
    place = Path(path)
    try:
        if place.is_dir():
            return Kind.ANNOTATIONS if (place / "metadata.csv").is_file() else Kind.FOLDER
    except (OSError, ValueError):
        # Opening it says what is wrong with the path.
        pass
    with opened(place, BYTE_LIMIT, InvalidImage) as file:
        head = file.read(HEAD)
    if not head:
        raise InvalidImage(f"{path}: expected a photo, labels or annotations, got an empty file")
    if head.startswith(JPEG_SIGNATURE):
        return Kind.PHOTO
    if not head.startswith(PNG_SIGNATURE):
        if not head.lstrip().startswith(ANNOTATION_STARTS):
            raise InvalidImage(
                f"{path}: expected a photo (JPEG or PNG), labels (PNG) or annotations (JSON, .npy, .npz), got "
                f"something else ({head[:8]!r}...); convert other images to JPEG or PNG"
            )
        return Kind.ANNOTATIONS
    if len(head) < HEAD or head[25] not in (GREY, PALETTE):
        return Kind.PHOTO
    if head[25] == PALETTE:
        values = read_photo(place).astype(np.int32) @ (2**16, 2**8, 1)
    elif head[24] >= WHOLE_BYTES:
        values = read_labels(place)
    else:
        return Kind.LABELS
    return Kind.LABELS if _is_flat(values) else Kind.PHOTO


def _is_flat(values: NDArray[np.signedinteger[Any]]) -> bool:
    """Whether values lie in large pieces, as labels do."""
    top, left = (max(0, (size - WINDOW) // 2) for size in values.shape)
    part = values[top : top + WINDOW, left : left + WINDOW]
    index = np.arange(part.size).reshape(part.shape)
    beside, below = part[:, 1:] == part[:, :-1], part[1:] == part[:-1]
    ones = np.concatenate([index[:, 1:][beside], index[1:][below]])
    others = np.concatenate([index[:, :-1][beside], index[:-1][below]])
    joined = coo_array((np.ones(len(ones), dtype=np.bool_), (ones, others)), shape=(part.size, part.size))
    pieces = connected_components(joined, directed=False, return_labels=False)
    return bool(pieces <= FEW or part.size >= SMALL * pieces)


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """How to look at an input.

    Parameters
    ----------
    segmenter, options, background, roi, settings
        For photos: see `pscover.perception.perceive.perceive`. A background or region that is given is held against
        annotations with a photo too.
    pixels_per_cm
        Scale of the photo.
    basket
        Where garments are taken, (x, y) in pixels of the photo; by default the middle of the right edge.
    """

    segmenter: str | Segmenter = "classical"
    options: dict[str, Any] = field(default_factory=dict)
    background: str | Background = "auto"
    roi: Polygon | None = None
    pixels_per_cm: float = PAPER_PIXELS_PER_CM
    basket: tuple[float, float] | None = None
    settings: Settings = field(default_factory=Settings)

    def read(
        self,
        path: str | PathLike[str],
        *,
        kind: Kind | None = None,
        photo: str | PathLike[str] | None = None,
        depth: DepthLike | None = None,
    ) -> Seen:
        """What a file shows.

        Parameters
        ----------
        path
            Of a photo, a label PNG, or annotations.
        kind
            What it is; by default its content says it.
        photo
            Path of the photo that labels or annotations were made from. Masks of Segment Anything's generators cover the
            surface too: with the photo, they are held against its cloth map.

        Raises
        ------
        InvalidImage
            If a file cannot be read, is damaged, or does not fit the other.
        InvalidSettings, UnknownName, MissingDependency
            As `perceive`.
        """
        match kind or kind_of(path):
            case Kind.PHOTO:
                return self.photo(path, depth=depth)
            case Kind.LABELS:
                return self._labels(path, photo, depth)
            case Kind.ANNOTATIONS:
                return self._annotations(path, photo, depth)
            case _:
                raise InvalidImage(f"{path}: expected a file, got a directory; read its files one by one")

    def photo(self, photo: str | PathLike[str] | ArrayLike, *, depth: DepthLike | None = None) -> Seen:
        """What a photo shows, given by its path or as 8-bit RGB of shape (H, W, 3); depth as for `read`.

        Examples
        --------
        >>> photo = np.full((60, 80, 3), 180, dtype=np.uint8)
        >>> photo[10:50, 10:40] = (200, 20, 20)
        >>> seen = Look().photo(photo)
        >>> seen.scene.garments, seen.origin
        (1, 'photo of 80 x 60 pixels, segmented by classical, background auto')
        """
        if isinstance(self.segmenter, str):
            name, options = self.segmenter, ", ".join(f"{key}={value}" for key, value in self.options.items())
        else:
            name, options = self.segmenter.name, ""
        said = f"segmented by {name}{f' ({options})' if options else ''}"
        return found(self._perceived(photo, depth, self.segmenter, self.options), said)

    def _perceived(
        self,
        photo: str | PathLike[str] | ArrayLike,
        depth: DepthLike | None,
        segmenter: str | Segmenter,
        options: dict[str, Any],
    ) -> Perception:
        return perceive(
            photo,
            depth=depth,
            segmenter=segmenter,
            options=options,
            background=self.background,
            roi=self.roi,
            pixels_per_cm=self.pixels_per_cm,
            basket=self.basket,
            settings=self.settings,
        )

    def _labels(self, path: str | PathLike[str], photo: str | PathLike[str] | None, depth: DepthLike | None) -> Seen:
        watch = Stopwatch()
        with watch.stage("read"):
            scene = Scene.read(path, photo=photo, pixels_per_cm=self.pixels_per_cm, basket=self.basket)
        seen = Seen.whole(scene, f"labels of {scene.shape[1]} x {scene.shape[0]} pixels")
        heights = _heights(depth, seen.grid, watch)
        return replace(seen, stages=watch.stages, heights=heights)

    def _annotations(self, path: str | PathLike[str], photo: str | PathLike[str] | None, depth: DepthLike | None) -> Seen:
        watch = Stopwatch()
        with watch.stage("annotations"):
            format_name = format_of(path)
            picture = None if photo is None else read_photo(photo)
            shape = None if picture is None else (picture.shape[0], picture.shape[1])
            given = _masks(path, photo, shape)
        said = f"{len(given.masks)} masks ({format_name})"
        if photo is not None and (format_name in GENERATED or self.roi is not None or self.background != "auto"):
            perception = self._perceived(photo, depth, Given(given), {})
            return replace(
                found(perception, f"{said} held against its cloth map"), stages=(*watch.stages, *perception.stages)
            )
        with watch.stage("clean-up"):
            grid = Grid.over(given.shape, pixels_per_cm=self.pixels_per_cm, pixel_limit=self.settings.pixel_limit)
            if format_name in GENERATED:
                labels, names, scores, rest = _cleaned(given, grid, self.settings)
                said += f"; no photo is given, so {rest} taken for the surface by place and size"
            else:
                labels, names, scores = _as_they_are(given, grid)
                said += ", taken as they are"
            scene = Scene.of(
                labels,
                pixels_per_cm=self.pixels_per_cm * grid.factor,
                basket=None if self.basket is None else grid.from_photo(*self.basket),
                names=names,
                source=str(path),
                photo=None if picture is None else grid.scaled(picture),
            )
        heights = _heights(depth, grid, watch)
        origin = f"annotations of an image of {given.shape[1]} x {given.shape[0]} pixels: {said}"
        return Seen(scene=scene, grid=grid, origin=origin, scores=scores, stages=watch.stages, heights=heights)


class Given:
    """Masks made elsewhere, in the place of a segmenter's.

    Parameters
    ----------
    annotations
        The masks, of the photo's size.
    """

    name: ClassVar[str] = "annotations"
    requires: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    def __init__(self, annotations: Annotations) -> None:
        self.annotations = annotations

    def __repr__(self) -> str:
        return f"annotations of {self.annotations.source}"

    def segment(self, photo: NDArray[np.uint8], cloth: NDArray[np.bool_]) -> Segmentation:
        """The masks on the grid of the photo that is given here."""
        grid = Grid(photo_shape=self.annotations.shape, shape=(photo.shape[0], photo.shape[1]))
        return Segmentation(masks=_on_grid(self.annotations.masks, grid))


def found(perception: Perception, said: str) -> Seen:
    """What a perception found; `said` is by what."""
    height, width = perception.grid.photo_shape
    shape = perception.scene.shape
    coarser = "" if shape == (height, width) else f", on a grid of {shape[1]} x {shape[0]}"
    ground = perception.provenance.background
    region = ", within a region of interest" if perception.provenance.roi else ""
    return Seen(
        scene=perception.scene,
        grid=perception.grid,
        origin=f"photo of {width} x {height} pixels, {said}, background {ground}{region}{coarser}",
        scores=perception.scores,
        stages=perception.stages,
        roi=perception.provenance.roi,
        heights=perception.heights,
    )


def _heights(depth: DepthLike | None, grid: Grid, watch: Stopwatch) -> HeightMap | None:
    """Heights on the grid over the image that labels or annotations are of."""
    if depth is None:
        return None
    with watch.stage("depth"):
        return Depth.of(depth).heights(grid)


def _masks(path: str | PathLike[str], photo: str | PathLike[str] | None, shape: tuple[int, int] | None) -> Annotations:
    """The masks of a file; where it describes several images, those of the one with the photo's name."""
    if photo is not None:
        with suppress(InvalidImage):
            return read_annotations(path, shape=shape, image=Path(photo).name)
    return read_annotations(path, shape=shape)


def _on_grid(masks: Sequence[Mask], grid: Grid) -> tuple[Mask, ...]:
    """The masks by nearest pixels; those that fall between pixels are left out."""
    if grid.shape == grid.photo_shape:
        return tuple(masks)
    moved = []
    for mask in masks:
        pixels = grid.nearest(mask.pixels(grid.photo_shape))
        if pixels.any():
            moved.append(Mask.of(pixels, score=mask.score, name=mask.name))
    return tuple(moved)


def _cleaned(
    given: Annotations, grid: Grid, settings: Settings
) -> tuple[NDArray[np.int32], list[str], tuple[float, ...], str]:
    """Labels of a generator's masks without the surface's, and how many those were."""
    masks = _on_grid(given.masks, grid)
    kept = [mask for mask in masks if not _is_surface(mask, grid.shape)]
    cloth = np.zeros(grid.shape, dtype=np.bool_)
    for mask in kept:
        cloth[mask.window] |= mask.bits
    labels = to_labels(kept, cloth, settings.clean_up)
    gone = len(masks) - len(kept)
    return labels.image, _named(labels.names), labels.scores, "1 mask was" if gone == 1 else f"{gone} masks were"


def _is_surface(mask: Mask, shape: tuple[int, int]) -> bool:
    (rows, columns), (height, width) = mask.window, shape
    sides = (rows.start == 0) + (columns.start == 0) + (rows.stop == height) + (columns.stop == width)
    share = mask.area / (height * width)
    return share > LARGEST_SHARE or (sides >= SURFACE_SIDES and share > SURFACE_SHARE)


def _as_they_are(given: Annotations, grid: Grid) -> tuple[NDArray[np.int32], list[str], tuple[float, ...]]:
    """Labels of masks that are trusted: smaller ones lie on larger ones, and one that is hidden is none."""
    labels = grid.nearest(painted(given))
    present = np.unique(labels[labels > 0]).tolist()
    names = [given.masks[label - 1].name for label in present]
    return labels, _named(names), tuple(given.masks[label - 1].score for label in present)


def _named(names: Sequence[str]) -> list[str]:
    """Names that tell garments apart: those that several share, and empty ones, get numbers."""
    plain = [name or "garment" for name in names]
    return [f"{name} {k}" if not names[k - 1] or plain.count(name) > 1 else name for k, name in enumerate(plain, start=1)]

"""From photo to scene: region of interest, cloth map, masks, one label a pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover import registry
from pscover.errors import InvalidImage, InvalidSettings, MissingDependency
from pscover.images import PIXEL_LIMIT, read_photo
from pscover.perception.background import Auto, Background, EmptyTable, check_size, parse_background
from pscover.perception.cleanup import CleanUp, to_labels
from pscover.perception.cloth import ClothMap, ClothSettings, cloth_by_mask, cloth_map
from pscover.perception.colour import Photo, opencv, rgb, smooth_lab
from pscover.perception.depth import Depth, HeightMap
from pscover.perception.grid import PAPER_PIXELS_PER_CM, Grid
from pscover.perception.mask import Mask
from pscover.perception.raised import raised
from pscover.perception.roi import Polygon, check_polygon, filled, parse_polygon, region, void
from pscover.perception.segmenter import Segmentation, Segmenter, Stage
from pscover.perception.stopwatch import Stopwatch
from pscover.scene import Scene

BoolImage = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How a photo is read, apart from the segmenter's own parameters.

    Parameters
    ----------
    cloth
        How cloth is told from the surface.
    clean_up
        How masks become labels.
    pixel_limit
        The most pixels of the grid on which perception works.
    cloth_height_cm
        Height above the table from which a pixel is cloth whatever its colour, where there is depth: for garments of the
        surface's colour. 0 for none: heights are only shown. It should lie above the camera's noise and below the cloth's
        thickness: 0.5 with a noise of 2 mm finds all white garments on a white sheet, of which colour finds none
        (`bench/depth_table.py`).
    """

    cloth: ClothSettings = field(default_factory=ClothSettings)
    clean_up: CleanUp = field(default_factory=CleanUp)
    pixel_limit: int = 400_000
    cloth_height_cm: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.cloth_height_cm < math.inf:
            raise InvalidSettings(f"cloth_height_cm: expected centimetres, at least 0, got {self.cloth_height_cm!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """How a scene was made.

    Parameters
    ----------
    photo
        Path of the photo, or "array".
    segmenter
        The segmenter with its parameters.
    background
        What was said of the surface.
    roi
        Corners of the region of interest in pixels of the photo; empty for the whole photo.
    settings
        All others.
    """

    photo: str
    segmenter: str
    background: str
    roi: tuple[tuple[float, float], ...]
    settings: Settings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Perception:
    """A photo, understood.

    Everything lies on the grid: `scene`, `cloth_map` and `masks` have its shape, and the scene's `pixels_per_cm` and
    `basket` are in its pixels. `grid.to_photo(x, y)` leads back to pixels of the photo; so does `labels` for the label
    image.

    Parameters
    ----------
    scene
        One label a pixel.
    grid
        How it lies over the photo.
    cloth_map
        Where cloth was seen.
    masks
        What the segmenter found, before the clean-up.
    scores
        How sure the segmenter was of each garment, in [0, 1]; 0 for cloth that no mask covered.
    stages
        Where the time went.
    provenance
        How the scene was made.
    heights
        Above the table, where depth was given.
    """

    scene: Scene
    grid: Grid
    cloth_map: ClothMap
    masks: tuple[Mask, ...]
    scores: tuple[float, ...]
    stages: tuple[Stage, ...]
    provenance: Provenance
    heights: HeightMap | None = None

    @property
    def labels(self) -> NDArray[np.int32]:
        """The label image at the photo's size."""
        return self.grid.enlarged(self.scene.labels)

    @property
    def seconds(self) -> float:
        """Wall seconds of all stages."""
        return sum(stage.seconds for stage in self.stages)

    @property
    def cpu_seconds(self) -> float:
        """CPU seconds of all stages."""
        return sum(stage.cpu_seconds for stage in self.stages)


def perceive(
    photo: str | PathLike[str] | ArrayLike,
    *,
    depth: Depth | str | PathLike[str] | ArrayLike | None = None,
    segmenter: str | Segmenter = "classical",
    options: dict[str, Any] | None = None,
    background: str | Background = "auto",
    roi: str | Polygon | None = None,
    pixels_per_cm: float = PAPER_PIXELS_PER_CM,
    basket: tuple[float, float] | None = None,
    settings: Settings | None = None,
) -> Perception:
    """The garments that a photo shows (paper, section 3).

    Parameters
    ----------
    photo
        Path of a JPEG or PNG, or 8-bit RGB of shape (H, W, 3), or 8-bit grey of shape (H, W).
    depth
        Of the same pixels: a path, an array, or either with scale, camera and table; see `pscover.perception.depth.Depth`.
        Heights are shown; `Settings.cloth_height_cm` lets them tell cloth, too.
    segmenter
        A registered name, or a segmenter.
    options
        Parameters of a segmenter given by name.
    background
        What the surface looks like: "auto" (the colours along the border), a colour ("R,G,B" or "#rrggbb"), or the path
        of a photo of the empty table.
    roi
        The region of interest, corners (x, y) in pixels of the photo, or "x,y x,y x,y ..."; by default the whole photo.
        Tape, furniture and hands should lie outside.
    pixels_per_cm
        Scale of the photo.
    basket
        Where garments are taken, (x, y) in pixels of the photo; by default the middle of the right edge.
    settings
        All others.

    Returns
    -------
    Perception

    Raises
    ------
    InvalidImage
        If the photo cannot be read.
    InvalidSettings, UnknownName
        If an argument is outside its domain.
    MissingDependency
        If the segmenter's packages are not installed.

    Examples
    --------
    >>> photo = np.full((60, 80, 3), 180, dtype=np.uint8)
    >>> photo[10:40, 10:40], photo[10:40, 40:70] = (200, 20, 20), (20, 20, 200)
    >>> found = perceive(photo)
    >>> found.scene.garments, bool(found.scene.labels[25, 25]), bool(found.scene.labels[5, 5])
    (2, True, False)
    """
    using = settings or Settings()
    finder = _segmenter(segmenter, options)
    ground = parse_background(background)
    corners = _corners(roi)
    watch = Stopwatch()
    with watch.stage("read"):
        original = _read(photo)
        shape = original.shape[0], original.shape[1]
        grid = Grid.over(shape, pixels_per_cm=pixels_per_cm, pixel_limit=using.pixel_limit)
        if isinstance(ground, EmptyTable):
            check_size(ground, shape)
        picture = grid.scaled(original)
        del original
    with watch.stage("cloth"):
        inside, seen = _region(picture, corners, grid)
        cloth = cloth_map(seen, ground, inside=inside, grid=grid, settings=using.cloth)
    heights = None
    if depth is not None:
        with watch.stage("depth"):
            heights = Depth.of(depth).heights(grid, inside)
    elif using.cloth_height_cm:
        raise InvalidSettings("cloth_height_cm: expected a depth image with it, got none; give one, or leave it out")
    cloth = raised(cloth, heights, using.cloth_height_cm, using.cloth)
    by_mask, looked = using.cloth.decision == "mask", watch.stages
    found = _segmented(finder, seen, cloth.inside if by_mask else cloth.cloth, watch)
    with watch.stage("clean-up"):
        if by_mask:
            cloth = raised(cloth_by_mask(cloth, found.masks, using.cloth), heights, using.cloth_height_cm, using.cloth)
        image = smooth_lab(seen, using.cloth.median)
        labels = to_labels(found.masks, cloth.cloth, using.clean_up, image=image)
        scene = Scene.of(
            labels.image,
            pixels_per_cm=pixels_per_cm * grid.factor,
            basket=None if basket is None else grid.from_photo(*basket),
            names=[name or f"garment {k}" for k, name in enumerate(labels.names, start=1)],
            source=_path(photo),
            photo=picture,
        )
    return Perception(
        scene=scene,
        grid=grid,
        cloth_map=cloth,
        masks=found.masks,
        scores=labels.scores,
        stages=(*looked, *(found.stages or watch.stages[len(looked) : -1]), watch.stages[-1]),
        provenance=Provenance(
            photo=_path(photo), segmenter=repr(finder), background=_said(ground), roi=corners, settings=using
        ),
        heights=heights,
    )


def _segmenter(segmenter: str | Segmenter, options: dict[str, Any] | None) -> Segmenter:
    if not isinstance(segmenter, str):
        if options:
            raise InvalidSettings("options: expected none for a segmenter that is given as an object")
        return segmenter
    found = registry.lookup("segmenter", segmenter)
    absent = registry.missing(found)
    if absent:
        raise MissingDependency.for_extra(f"segmenter {found.name!r}", absent, found.extra)
    return cast(Segmenter, registry.make("segmenter", segmenter, options))


def _segmented(finder: Segmenter, photo: Photo, cloth: BoolImage, watch: Stopwatch) -> Segmentation:
    with watch.stage("segment"):
        return finder.segment(photo, cloth)


def _corners(roi: str | Polygon | None) -> tuple[tuple[float, float], ...]:
    if roi is None:
        return ()
    return parse_polygon(roi) if isinstance(roi, str) else check_polygon(roi)


def _read(photo: str | PathLike[str] | ArrayLike) -> Photo:
    if isinstance(photo, str | PathLike):
        return read_photo(photo)
    picture = rgb(photo)
    if picture.shape[0] * picture.shape[1] > PIXEL_LIMIT:
        raise InvalidImage(f"photo: expected at most {PIXEL_LIMIT} pixels, got shape {picture.shape}; scale it down")
    return picture


def _region(picture: Photo, corners: tuple[tuple[float, float], ...], grid: Grid) -> tuple[BoolImage, Photo]:
    """The region of interest on the grid without what the camera did not fill, and the photo with its holes filled."""
    inside = region([grid.from_photo(*corner) for corner in corners] or None, grid.shape)
    unknown = void(picture)
    if not unknown.any():
        return inside, picture
    cv2 = opencv("a region of interest")
    _, parts = cv2.connectedComponents(unknown.astype(np.uint8), connectivity=8)
    outer = np.unique(np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]]))
    bars = np.isin(parts, outer[outer > 0])
    around = cv2.dilate(unknown.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
    return (inside & ~bars if (inside & ~bars).any() else inside), filled(picture, around)


def _path(photo: str | PathLike[str] | ArrayLike) -> str:
    return str(photo) if isinstance(photo, str | PathLike) else "array"


def _said(background: Background) -> str:
    if isinstance(background, Auto):
        return "auto"
    if isinstance(background, EmptyTable):
        return "photo of the empty table"
    return f"{background.red},{background.green},{background.blue}"

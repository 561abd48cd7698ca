"""Options that say how to look at a photo, for the commands that take one, and what they make of it."""

from __future__ import annotations

import dataclasses
import functools
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli import depth_files
from pscover.cli.depth_files import DepthFiles
from pscover.cli.fail import Exit
from pscover.cli.options import FILE, known, parameter_option, point, together

if TYPE_CHECKING:
    from pscover.inputs import Kind, Look
    from pscover.perception.perceive import Settings
    from pscover.seen import Seen

PAPER_SCALE = 4.7
CORNER = re.compile(r"-?[\d.]+(e\d+)?,-?[\d.]+(e\d+)?;?")
ROI_LIMIT = 2**20
OWN = ("pixel_limit", "cloth_height_cm")
"""Settings of perception that are no part's."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Eyes:
    """What the options of a command say of looking.

    Parameters
    ----------
    look
        How.
    kind
        What the input is, or None where its content says it.
    photo
        The photo that labels or annotations were made from.
    depth
        Where depth images are, or None.
    """

    look: Look
    kind: Kind | None
    photo: Path | None
    depth: DepthFiles | None = None

    def kind_of(self, path: Path) -> Kind:
        """What a file, or folder, is."""
        from pscover.inputs import Kind, kind_of

        if not path.is_dir():
            return self.kind or kind_of(path)
        found = Kind.FOLDER if self.kind in (Kind.PHOTO, Kind.LABELS) else self.kind or kind_of(path)
        if found is Kind.FOLDER and self.depth is not None and not self.depth.place.is_dir():
            raise click.UsageError("--depth is a file; for a folder of photos, name a folder with a depth image of each")
        return found

    def photo_of(self, path: Path, kind: Kind) -> Path | None:
        """The photo to look at with an input: the one that was named, or the one beside a file of labels."""
        from pscover.inputs import Kind

        if kind is Kind.FOLDER:
            return None
        if kind is Kind.PHOTO:
            if self.photo is not None:
                raise click.UsageError("--photo goes with labels and annotations; the input is a photo itself")
            return None
        if (self.look.roi is not None or self.look.background != "auto") and (kind is Kind.LABELS or self.photo is None):
            what = "labels are taken as they are" if kind is Kind.LABELS else "annotations need --photo for that"
            raise click.UsageError(f"--roi and --background are for photos; {what}")
        return self.photo or (sibling(path) if kind is Kind.LABELS else None)

    def inputs(self, path: Path) -> list[Path]:
        """The files that are read for an input: itself, its photo, its depth."""
        photo = self.photo_of(path, self.kind_of(path))
        depth = None if self.depth is None else self.depth.path_of(path)
        return [file for file in (path, photo, depth) if file is not None]

    def read(self, path: Path) -> Seen:
        """What the file shows."""
        kind = self.kind_of(path)
        depth = None if self.depth is None else self.depth.of(path)
        return self.look.read(path, kind=kind, photo=self.photo_of(path, kind), depth=depth)


class Corners(click.Command):
    """A command whose --roi may be followed by corners with spaces between them, quoted or not."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Join the corners after --roi into one value."""
        joined: list[str] = []
        corners = False
        for word in args:
            if corners and CORNER.fullmatch(word) and CORNER.fullmatch(joined[-1].split()[-1]):
                joined[-1] += f" {word}"
                continue
            corners = bool(joined) and joined[-1] == "--roi"
            joined.append(word)
        return super().parse_args(ctx, joined)


OPTIONS = together(
    (
        click.option(
            "--segmenter",
            default="classical",
            show_default=True,
            metavar="NAME",
            help="What finds the garments in a photo; see `pscover segmenters`.",
            shell_complete=known("segmenter"),
        ),
        parameter_option("--set-segmenter", "segmenter_options", "segmenter"),
        click.option(
            "--background",
            default="auto",
            show_default=True,
            metavar="COLOUR|FILE",
            help="The empty surface: auto (the photo's border), #rrggbb or r,g,b, or a photo of the empty table.",
        ),
        click.option(
            "--roi",
            metavar="X,Y X,Y ...",
            help="Corners of the region of interest in pixels, or a file that has them.  [default: the whole photo]",
        ),
        click.option(
            *("--px-per-cm", "--pixels-per-cm", "pixels_per_cm"),
            type=float,
            default=PAPER_SCALE,
            show_default=True,
            help="Scale of the photo; the gripper is drawn to it.",
        ),
        click.option(
            "--basket", type=point, metavar="X,Y", help="In pixels; may lie outside.  [default: middle of right edge]"
        ),
        click.option(
            "--set-perception",
            "perception_options",
            type=str,
            multiple=True,
            metavar="NAME=VALUE",
            help="A setting of cloth map or clean-up: threshold, decision, min_segment_area, ...; repeatable.",
        ),
        click.option(
            "--as",
            "kind",
            type=click.Choice(("photo", "labels", "annotations")),
            help="What the input is.  [default: its content says it]",
        ),
        click.option("--photo", type=FILE, help="Of labels or annotations.  [default: x.jpg or x.png beside x.labels.png]"),
        depth_files.OPTIONS,
    )
)


def looking(command: Callable[..., Exit]) -> Callable[..., Exit]:
    """Give a command the options of looking, as one argument `eyes`."""

    @functools.wraps(command)
    def wrapped(
        *,
        segmenter: str,
        segmenter_options: tuple[tuple[str, str], ...],
        background: str,
        roi: str | None,
        pixels_per_cm: float,
        basket: tuple[float, float] | None,
        perception_options: tuple[str, ...],
        kind: str | None,
        photo: Path | None,
        depth: Path | None,
        depth_scale: float | None,
        intrinsics: tuple[float, ...] | None,
        table: tuple[float, ...] | None,
        **others: Any,
    ) -> Exit:
        from pscover.inputs import Kind, Look
        from pscover.perception.background import parse_background

        look = Look(
            segmenter=segmenter,
            options=dict(segmenter_options),
            # A photo of the empty table is read once, however many photos follow.
            background=background if background == "auto" else parse_background(background),
            roi=None if roi is None else region(roi),
            pixels_per_cm=pixels_per_cm,
            basket=basket,
            settings=settings(perception_options),
        )
        eyes = Eyes(
            look=look,
            kind=None if kind is None else Kind(kind),
            photo=photo,
            depth=depth_files.depth_files(depth, depth_scale, intrinsics, table),
        )
        return command(eyes=eyes, **others)

    return OPTIONS(wrapped)


def region(text: str) -> tuple[tuple[float, float], ...]:
    """The corners that are written in the text, or in the file that it names: as text, or as JSON [[x, y], ...]."""
    from pscover.errors import InvalidSettings
    from pscover.files import read_bytes
    from pscover.perception.roi import check_polygon, parse_polygon

    if CORNER.fullmatch(text.split()[0] if text.split() else ""):
        return parse_polygon(text)
    path = Path(text)
    content = read_bytes(path, ROI_LIMIT, InvalidSettings).decode("utf-8", "replace")
    if not content.lstrip().startswith("["):
        return parse_polygon(content)
    try:
        return check_polygon([(x, y) for x, y in json.loads(content)])
    except (ValueError, TypeError, RecursionError):
        raise InvalidSettings(f'{path}: expected corners "x,y x,y x,y ..." or JSON [[x, y], ...]') from None


def settings(given: tuple[str, ...]) -> Settings:
    """The settings of perception with those of the parameters that were given."""
    import msgspec

    from pscover.cli.options import assignment
    from pscover.errors import InvalidSettings, UnknownName
    from pscover.perception.cleanup import CleanUp
    from pscover.perception.cloth import ClothSettings
    from pscover.perception.perceive import Settings

    types: dict[str, type[Any]] = {"cloth": ClothSettings, "clean_up": CleanUp}
    owners = {field.name: part for part, type_ in types.items() for field in dataclasses.fields(type_)}
    own: dict[str, Any] = {part: {} for part in types}
    for name, value in map(assignment, given):
        if name not in owners and name not in OWN:
            raise UnknownName.among("setting of perception", name, [*owners, *OWN])
        (own[owners[name]] if name in owners else own)[name] = value
    try:
        return msgspec.convert(own, type=Settings, strict=False)
    except msgspec.ValidationError as error:
        raise InvalidSettings(f"--set-perception: {error}") from None


def sibling(path: Path, ending: str = ".labels.png") -> Path | None:
    """The photo beside a file of labels, or of depth: x.jpg, x.jpeg or x.png beside x.labels.png."""
    stem = path.name.removesuffix(ending)
    if stem == path.name:
        return None
    beside = (path.with_name(stem + suffix) for suffix in (".jpg", ".jpeg", ".png"))
    return next((other for other in beside if other.is_file()), None)


def stem_of(path: Path) -> str:
    """What outputs are named after an input: its name without ending, and without ".labels"."""
    name = path.name if path.is_dir() else path.stem
    return name.removesuffix(".labels") or "scene"


TABLE_LIMIT = 300.0
"""Centimetres that a table hardly measures."""
MOST = 0.6
"""Share of a photo that garments hardly fill."""


def notes(seen: Seen) -> list[str]:
    """What to say of a photo that may have been looked at otherwise than was meant."""
    import numpy as np

    said = []
    height, width = seen.grid.photo_shape
    wide, tall = width / seen.pixels_per_cm, height / seen.pixels_per_cm
    if max(wide, tall) > TABLE_LIMIT:
        said.append(
            f"note: at {seen.pixels_per_cm:g} pixels per cm this picture shows {wide / 100:.1f} m x {tall / 100:.1f} m; "
            "if that is not so, give --px-per-cm"
        )
    segments = seen.scene.segments
    rim = np.concatenate([segments[0], segments[-1], segments[:, 0], segments[:, -1]])
    touching = len(np.unique(rim[rim >= 0]))
    if touching and seen.origin.startswith("photo") and not seen.roi:
        among = f"{touching} of {seen.scene.garments} segments touch"
        among = among.replace("segments touch", "segments touches") if touching == 1 else among
        said.append(f"note: {among} the picture's border; --roi leaves out furniture, tape and whatever is no garment")
    if seen.origin.startswith("photo"):
        said += _doubts(seen)
    if "no photo is given" in seen.origin:
        said.append("note: parts of the surface may be left among the garments; --photo tells them apart by their colour")
    return said + depth_files.depth_notes(seen)


def _doubts(seen: Seen) -> list[str]:
    """What to say where next to nothing, or next to everything, was taken for garments."""
    from pscover.perception.roi import region

    if not seen.scene.garments:
        return [
            "note: nothing has another colour than the surface (--background says what that looks like); garments of its "
            "colour are found by --depth with --set-perception cloth_height_cm=0.5, or by --segmenter mobile-sam with "
            "--set-perception decision=mask"
        ]
    inside = region([seen.grid.from_photo(*corner) for corner in seen.roi] or None, seen.grid.shape)
    share = float((seen.scene.labels[inside] > 0).mean())
    if share <= MOST:
        return []
    whole = "region of interest" if seen.roi else "photo"
    return [
        f"note: {share:.0%} of the {whole} is taken for garments; if the surface is among them, say what it looks like with "
        "--background"
    ]

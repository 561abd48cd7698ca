"""Options that name depth images, and which of them belongs to which photo."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.options import FILE, together

if TYPE_CHECKING:
    from pscover.perception.depth import Depth
    from pscover.seen import Seen

ENDINGS = (".depth.png", "_depth.png", ".depth.npy", "_depth.npy", ".npy", ".png")
"""What follows a photo's stem in the name of its depth image, the first that is there."""
HEIGHTS = (("top cm", "right"), ("mean cm", "right"))
"""Columns that depth adds to a table of garments."""
NEAR, FAR = 0.1, 10.0
"""Metres that a camera is hardly nearer to a table, or farther from it."""
HOLES = 0.25
"""Share of pixels without depth that is worth a note."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthFiles:
    """Where depth images are.

    Parameters
    ----------
    place
        A depth image, or a folder with one for each photo.
    how
        Scale, camera and table of all of them; its image is `place`.
    """

    place: Path
    how: Depth

    def of(self, photo: Path) -> Depth:
        """The depth image of a photo: the file, or that of the photo's stem in the folder.

        Raises
        ------
        InvalidImage
            If the folder has none.
        """
        return replace(self.how, image=self.path_of(photo))

    def path_of(self, photo: Path) -> Path:
        """Its path."""
        from pscover.cli.look import stem_of
        from pscover.errors import InvalidImage

        if not self.place.is_dir():
            return self.place
        stem = stem_of(photo)
        for ending in ENDINGS:
            path = self.place / f"{stem}{ending}"
            if path.is_file() and not (photo.exists() and path.samefile(photo)):
                return path
        tried = ", ".join(f"{stem}{ending}" for ending in ENDINGS)
        raise InvalidImage(f"{photo}: no depth image of it in {self.place}; expected one of {tried}")


def _numbers(text: Any, counts: tuple[int, ...], what: str) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in str(text).split(","))
    except ValueError:
        values = ()
    if len(values) not in counts:
        raise click.BadParameter(f"expected {what}, got {text!r}")
    return values


def intrinsics(text: Any) -> tuple[float, ...]:
    """Focal lengths and principal point, written FX,FY,CX,CY."""
    return text if isinstance(text, tuple) else _numbers(text, (4,), "fx,fy,cx,cy in pixels: four numbers with commas")


def plane(text: Any) -> tuple[float, ...]:
    """A distance, or a plane, written A,B,C."""
    what = "the distance of the table in metres, or a,b,c of the plane 1/z = a + b x + c y"
    return text if isinstance(text, tuple) else _numbers(text, (1, 3), what)


OPTIONS = together(
    (
        click.option(
            "--depth",
            type=FILE,
            metavar="FILE|FOLDER",
            help="Depth of the same pixels: a 16-bit PNG or .npy, or a folder with PHOTO.depth.png, PHOTO.npy, ... of each "
            "photo. Heights above the table are shown.",
        ),
        click.option(
            "--depth-scale",
            type=float,
            metavar="METRES",
            help="Metres that one unit of the depth is.  [default: 0.001 for whole numbers, 1 for floats]",
        ),
        click.option(
            "--intrinsics",
            type=intrinsics,
            metavar="FX,FY,CX,CY",
            help="Of the depth camera, in pixels; for heights perpendicular to a table that it does not look straight at.",
        ),
        click.option(
            "--table",
            type=plane,
            metavar="METRES|A,B,C",
            help="The table, if it is known: how far below the camera, or its plane 1/z = A + B x + C y.  [default: fitted]",
        ),
    )
)


def depth_files(
    depth: Path | None, scale: float | None, camera: tuple[float, ...] | None, table: tuple[float, ...] | None
) -> DepthFiles | None:
    """What the options say.

    Raises
    ------
    InvalidSettings
        If a number is outside its domain.
    """
    if depth is None:
        given = {"--depth-scale": scale, "--intrinsics": camera, "--table": table}
        if lonely := [name for name, value in given.items() if value is not None]:
            raise click.UsageError(f"{lonely[0]} says how a depth image is meant; name one with --depth")
        return None
    from pscover.perception.depth import Depth
    from pscover.perception.table_plane import Intrinsics, TablePlane

    lens = None if camera is None else Intrinsics(fx=camera[0], fy=camera[1], cx=camera[2], cy=camera[3])
    flat = None
    if table is not None:
        flat = (
            TablePlane.level(table[0])
            if len(table) == 1
            else TablePlane(offset=table[0], slope_x=table[1], slope_y=table[2])
        )
    return DepthFiles(place=depth, how=Depth(image=depth, metres_per_unit=scale, camera=lens, table=flat))


def depth_notes(seen: Seen) -> list[str]:
    """What to say of a depth image that may have been read otherwise than was meant."""
    heights = seen.heights
    if heights is None:
        return []
    said = []
    away = seen.table_distance
    if not NEAR <= away <= FAR:
        said.append(f"note: by its depth image the table is {away:.3g} m away; if that is not so, give --depth-scale")
    if not heights.spread < float("inf"):
        said.append("note: no measured pixel lies near the table that --table gives; heights may be wrong")
    if heights.hole_share > HOLES:
        said.append(
            f"note: {heights.hole_share:.0%} of the pixels have no depth; they are shown with the height of the nearest"
        )
    return said

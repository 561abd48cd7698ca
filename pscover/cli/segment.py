"""`pscover segment`: from a photo to labels, without a plan."""

from __future__ import annotations

import importlib.util
import time as clock
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import Exit, say
from pscover.cli.look import Corners, Eyes, looking, notes, stem_of
from pscover.cli.options import FILE, json_option, quiet_option

if TYPE_CHECKING:
    from rich.table import Table

    from pscover.cli.folder import Outcome
    from pscover.seen import Seen

PICTURES = (".png", ".svg", ".pdf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """Where the parts of a segmentation go; None is nowhere."""

    labels: Path | None = None
    coco: Path | None = None
    picture: Path | None = None

    def check(self, inputs: list[Path]) -> None:
        """Raise unless all can be written."""
        from pscover.cli.output import require_distinct, require_writable

        require_distinct(self.labels, self.coco, self.picture)
        require_writable(self.labels, inputs, suffixes=(".png",))
        require_writable(self.coco, inputs, suffixes=(".json",))
        require_writable(self.picture, inputs, suffixes=PICTURES)

    def write(self, seen: Seen, source: Path) -> float:
        """Write them, and return the seconds that drawing took."""
        from pscover.perception.annotations import write_annotations
        from pscover.perception.connectors.label_png import write_labels

        if self.labels is not None:
            write_labels(seen.labels, self.labels)
        if self.coco is not None:
            write_annotations(_annotations(seen, source), self.coco, "coco")
        began = clock.monotonic()
        if self.picture is not None:
            from pscover.figures.scene import save_scene_figure

            save_scene_figure(seen, self.picture)
        return clock.monotonic() - began

    def announce(self) -> None:
        """Say where everything went."""
        from pscover.cli.output import wrote

        for path, what in ((self.labels, "the labels"), (self.coco, "the masks"), (self.picture, "the picture")):
            if path is not None:
                wrote(path, what)


@click.command("segment", cls=Corners, short_help="Find the garments in a photo, and write labels.")
@click.argument("photo_file", metavar="PHOTO", type=FILE)
@looking
@click.option("--output", "-o", type=FILE, metavar="FILE", help="Write the labels to a .png file; for a folder, a folder.")
@click.option("--coco", type=FILE, metavar="FILE", help="Write the masks as COCO JSON, run-length encoded.")
@click.option("--figure", type=FILE, metavar="FILE", help="Picture.  [default: PHOTO.segments.png in the current folder]")
@click.option("--no-figure", is_flag=True, help="Draw no picture.")
@json_option
@quiet_option
def command(
    photo_file: Path,
    eyes: Eyes,
    output: Path | None,
    coco: Path | None,
    figure: Path | None,
    no_figure: bool,
    as_json: bool,
    quiet: bool,
) -> Exit:
    """Find the garments in PHOTO, a JPEG or PNG, and list them: areas in pixels of the photo and in square centimetres, and
    how sure the segmenter is of each. Annotations are taken too: their masks become one label a pixel.

    The labels are a PNG of the photo's size, 0 the surface, of 8 bits, or 16 for more than 255 segments. Of a folder, every
    photo is segmented; a bad one does not stop the rest, and the exit code then is 2.

    \b
    Examples:
      pscover segment photo.jpg -o photo.labels.png
      pscover segment photo.jpg --segmenter mobile-sam --coco photo.json
      pscover segment a.jpg --depth a.png --set-perception cloth_height_cm=0.5
      pscover segment photos/ -o labels/
    """
    from pscover.cli.live import watching
    from pscover.inputs import Kind

    if no_figure and figure is not None:
        raise click.UsageError("--figure and --no-figure exclude each other")
    kind = eyes.kind_of(photo_file)
    picture = _picture(photo_file, figure, no_figure=no_figure, quiet=quiet)
    if kind is Kind.FOLDER:
        if figure or coco:
            raise click.UsageError("--figure and --coco are for one photo; of a folder, -o DIR gets all")
        return _folder(photo_file, output, eyes, drawn=picture is not None, as_json=as_json, quiet=quiet)
    outputs = Outputs(labels=output, coco=coco, picture=picture)
    outputs.check(eyes.inputs(photo_file))
    with watching(f"looking at {photo_file.name}", quiet=quiet):
        seen = eyes.read(photo_file)
    for note in () if quiet else notes(seen):
        say(note)
    drawing = 0.0
    try:
        drawing = outputs.write(seen, photo_file)
    finally:
        _print(seen, outputs, drawing, as_json=as_json)
    if not quiet:
        outputs.announce()
    return Exit.VERIFIED


def segments(seen: Seen) -> list[dict[str, Any]]:
    """Name, label, area, score and height of each segment; the score is None where nobody says, heights without depth."""
    import numpy as np

    labels = seen.labels
    areas = np.bincount(seen.scene.segments.ravel() + 1, minlength=seen.scene.garments + 1)[1:]
    pixels = areas if labels.shape == seen.scene.shape else _areas(labels, seen.scene.values)
    rows, heights = [], seen.garment_heights
    for j, (name, label) in enumerate(zip(seen.scene.names, seen.scene.values.tolist(), strict=True)):
        area = float(areas[j]) / seen.scene.pixels_per_cm**2
        score = seen.scores[j] if seen.scores else None
        row = {"name": name, "label": label, "pixels": int(pixels[j]), "cm2": area, "score": score}
        high = {} if heights is None else {"top_cm": 100 * heights[j].top, "mean_cm": 100 * heights[j].mean}
        rows.append({**row, **high})
    return rows


def _areas(labels: Any, values: Any) -> Any:
    import numpy as np

    present, counts = np.unique(labels, return_counts=True)
    known = dict(zip(present.tolist(), counts.tolist(), strict=True))
    return [known.get(value, 0) for value in values.tolist()]


def _annotations(seen: Seen, source: Path) -> Any:
    """The segments as masks with their names and scores."""
    from pscover.perception.connectors.label_png import masks_of_labels

    made = masks_of_labels(seen.labels, str(source))
    scores = seen.scores or (1.0,) * len(made.masks)
    masks = [replace(m, name=n, score=s) for m, n, s in zip(made.masks, seen.scene.names, scores, strict=True)]
    return replace(made, masks=tuple(masks), image=source.name)


def _picture(photo: Path, figure: Path | None, *, no_figure: bool, quiet: bool) -> Path | None:
    """Where the picture goes, or None; it can be done without only if it was not asked for."""
    from pscover.errors import MissingDependency

    if no_figure:
        return None
    if importlib.util.find_spec("matplotlib") is None:
        missing = MissingDependency.for_extra("the picture of a scene", ["matplotlib"], "figures")
        if figure is not None:
            raise missing
        if not quiet:
            say(f"note: no picture: {missing}")
        return None
    return figure or Path(f"{stem_of(photo)}.segments.png")


def _print(seen: Seen, outputs: Outputs, drawing: float, *, as_json: bool) -> None:
    from pscover.cli.depth_files import HEIGHTS
    from pscover.cli.output import show, show_document
    from pscover.cli.tables import facts, grid
    from pscover.cli.words import NOTHING, count

    rows = segments(seen)
    times = {stage.name: stage.seconds for stage in seen.stages}
    if as_json:
        import msgspec

        from pscover.plan_document import depth_document

        height, width = seen.grid.photo_shape
        show_document(
            {
                "source": seen.scene.source,
                "origin": seen.origin,
                "width": width,
                "height": height,
                "pixels_per_cm": seen.pixels_per_cm,
                "segments": rows,
                "depth": None if seen.heights is None else msgspec.to_builtins(depth_document(seen.heights)),
                "seconds": times,
                "labels": outputs.labels,
                "coco": outputs.coco,
                "figure": outputs.picture,
            }
        )
        return
    high = HEIGHTS if seen.heights is not None else ()
    table = grid(("segment", "fill"), ("label", "right"), ("area px", "right"), ("cm2", "right"), *high, ("score", "right"))
    for row in rows:
        score = NOTHING if row["score"] is None else f"{row['score']:.2f}"
        heights = [f"{row[name]:.1f}" for name in ("top_cm", "mean_cm") if name in row]
        table.add_row(row["name"], str(row["label"]), str(row["pixels"]), f"{row['cm2']:.0f}", *heights, score)
    spent = [*times.items(), *([("picture", drawing)] if drawing else [])]
    total = f"{sum(value for _, value in spent):.2f} s: {', '.join(f'{name} {value:.2f}' for name, value in spent)}"
    said = [("input", seen.origin), *([("depth", seen.depth_origin)] if seen.heights is not None else []), ("time", total)]
    show(count(len(rows), "segment"), *(("", table) if rows else ()), "", facts(said))


def _folder(folder: Path, output: Path | None, eyes: Eyes, *, drawn: bool, as_json: bool, quiet: bool) -> Exit:
    from pscover.cli.folder import each, output_folder, photos_in, stems
    from pscover.cli.output import show, show_document

    paths = photos_in(folder)
    target, names = output_folder(output, folder), stems(paths)

    def work(path: Path) -> dict[str, Any]:
        named = names[path]
        outputs = Outputs(labels=target / f"{named}.labels.png", picture=target / f"{named}.segments.png" if drawn else None)
        outputs.check(eyes.inputs(path))
        seen = eyes.read(path)
        outputs.write(seen, path)
        return {"photo": path, "segments": segments(seen), "seconds": seen.seconds, "labels": outputs.labels}

    outcome = each(paths, work, verb="segmenting", quiet=quiet)
    if as_json:
        failed = [{"photo": failure.path, "error": failure.message} for failure in outcome.failures]
        done = [row for _, row in outcome.done]
        show_document({"photos": done, "failed": failed, "interrupted": outcome.interrupted})
    else:
        show(_table(outcome))
    outcome.report()
    if outcome.done and not quiet:
        say(f"wrote labels{' and pictures' if drawn else ''} of {len(outcome.done)} photos to {target}")
    return outcome.code(Exit.VERIFIED)


def _table(outcome: Outcome[dict[str, Any]]) -> Table:
    from rich.text import Text

    from pscover.cli.tables import grid
    from pscover.cli.words import NOTHING

    table = grid(("photo", "fill"), ("segments", "right"), ("cm2", "right"), ("seconds", "right"))
    for path, row in outcome.done:
        area = sum(segment["cm2"] for segment in row["segments"])
        table.add_row(path.name, str(len(row["segments"])), f"{area:.0f}", f"{row['seconds']:.2f}")
    for failure in outcome.failures:
        table.add_row(failure.path.name, Text("failed", style="bold red"), NOTHING, NOTHING)
    return table

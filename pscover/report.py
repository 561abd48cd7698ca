"""A plan as one HTML file that needs nothing else: photo, segments, parts, candidates and grasps, linked to tables.

The page loads nothing from anywhere: a content security policy forbids it, and lets only the page's own script run. It is
complete without the script, which adds the layers' switches and the links between picture and tables.
"""

from __future__ import annotations

import base64
import hashlib
import math
import re
from collections.abc import Mapping
from html import escape
from importlib import resources
from os import PathLike
from pathlib import Path

import numpy as np

import pscover
from pscover.figures.heights import top_of_scale
from pscover.figures.plan import headline
from pscover.figures.style import palette
from pscover.files import write_bytes
from pscover.grasping.partition import partition
from pscover.grasps import Grasp
from pscover.outlines import heights_data, outlines, picture_data
from pscover.perception.depth import GarmentHeight
from pscover.planning import Plan
from pscover.verify import Verdict, Verification, verify

TEMPLATE, STYLE, THEME = "report.html", "page.css", "theme.js"
PLACE = re.compile(r"\{\{(\w+)\}\}")
PARTS_LIMIT = 3000
"""More parts than this are not outlined."""


def render_report(plan: Plan, verification: Verification | None = None) -> bytes:
    """The page, in UTF-8.

    Parameters
    ----------
    plan
        What to show.
    verification
        Of its result; made here if it is not given.

    Raises
    ------
    MissingDependency
        Without OpenCV.

    Examples
    --------
    >>> from pscover.planning import plan
    >>> from pscover.scene import Scene
    >>> page = render_report(plan(Scene.of(np.ones((60, 90), dtype=int), names=["<b>sock</b>"]))).decode()
    >>> "&lt;b&gt;sock&lt;/b&gt;" in page, "<b>sock" in page
    (True, False)
    """
    template = resources.files("pscover").joinpath(TEMPLATE).read_text("utf-8")
    title, proof, _ = headline(plan)
    checked = verification or verify(plan.instance, plan.result)
    parts = {
        "name": escape(Path(plan.scene.source).name or "plan"),
        "title": escape(title),
        "proof": escape(proof),
        "mood": "short" if plan.unmet else "met",
        "cards": _cards(plan),
        "layers": _layers(plan),
        "picture": _picture(plan) + _scale(plan),
        "garments": _garments(plan),
        "grasps": _grasps(plan),
        "stages": _stages(plan),
        "facts": _facts(plan, checked),
        "version": escape(pscover.__version__),
    }
    return filled(template, parts)


def filled(template: str, parts: Mapping[str, str]) -> bytes:
    """A page of a template with {{name}} where a part belongs, in UTF-8.

    The style and the choice of light or dark that all pages share are put in besides, and the digest that lets the page's
    own script run.
    """
    template = template.replace("{{theme}}", resources.files("pscover").joinpath(THEME).read_text("utf-8"))
    script = template.partition("<script>")[2].partition("</script>")[0]
    shared = {
        "style": resources.files("pscover").joinpath(STYLE).read_text("utf-8"),
        "script_digest": base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii"),
    }
    # One pass: what is put in is never looked at again, whatever it is.
    page = PLACE.sub(lambda found: (shared | dict(parts))[found[1]], template)
    return page.encode("utf-8", "replace")


def save_report(plan: Plan, path: str | PathLike[str], verification: Verification | None = None) -> None:
    """Write the page to a file, whole or not at all.

    Raises
    ------
    MissingDependency
        Without OpenCV.
    PscoverError
        If the file cannot be written.
    """
    write_bytes(path, render_report(plan, verification))


def hexadecimal(count: int) -> list[str]:
    """Colours of garments as a page writes them.

    Examples
    --------
    >>> hexadecimal(1)
    ['#4c78a8']
    """
    return ["#" + "".join(f"{round(255 * channel):02x}" for channel in colour) for colour in palette(count).tolist()]


def _cards(plan: Plan) -> str:
    total = plan.seen.seconds + plan.seconds.candidates + plan.seconds.solve
    lowest = ((f"{plan.bound:g}", "at least needed"),) if math.isfinite(plan.bound) else ()
    cards = (
        (str(len(plan.grasps)), "grasps planned"),
        *lowest,
        (f"{plan.expected_removed:.1f}", f"of {plan.scene.garments} garments expected to go"),
        (f"{plan.instance.candidates:,}", "candidates"),
        (f"{total:.2f} s", "from input to plan"),
    )
    return "".join(f"<div class='card'><b>{escape(value)}</b><span>{escape(what)}</span></div>" for value, what in cards)


def _layers(plan: Plan) -> str:
    """A switch for each layer that the picture has."""
    names = ["photo"] if plan.scene.photo is not None else []
    names += ["heights"] if plan.seen.heights is not None else []
    names += ["segments", "parts", "candidates", "grasps"]
    off = {"heights", "parts", "candidates"} if plan.scene.photo is not None else {"heights"}
    return "".join(
        f"<label class='chip'><input type='checkbox' data-toggle='{name}'{'' if name in off else ' checked'}>"
        f"<i class='key {name}'></i>{name}</label>"
        for name in names
    )


def _picture(plan: Plan) -> str:
    height, width = plan.scene.shape
    margin = 0.03 * max(height, width)
    box = f"{-margin - 0.5:.1f} {-margin - 0.5:.1f} {width + 2 * margin:.1f} {height + 2 * margin:.1f}"
    frame = f"x='-0.5' y='-0.5' width='{width}' height='{height}'"
    layers = [f"<rect class='ground' {frame}/>"]
    if plan.scene.photo is not None:
        data = picture_data(plan.scene.photo)
        layers.append(f"<image data-layer='photo' {frame} preserveAspectRatio='none' href='{data}'/>")
    if plan.seen.heights is not None:
        data = heights_data(100 * plan.seen.heights.metres / top_of_scale(plan.seen.heights))
        layers.append(f"<image data-layer='heights' class='hidden' {frame} preserveAspectRatio='none' href='{data}'/>")
    layers += [_segments(plan), _parts(plan), _candidates(plan), _region(plan), _ellipses(plan), _basket(plan)]
    said = f"{plan.scene.garments} garments and {len(plan.grasps)} numbered grasps"
    return f"<svg viewBox='{box}' role='img' aria-label='{said}' xmlns='http://www.w3.org/2000/svg'>{''.join(layers)}</svg>"


def _scale(plan: Plan) -> str:
    """What the colours of the height map mean."""
    if plan.seen.heights is None:
        return ""
    top = top_of_scale(plan.seen.heights)
    more = "+" if 100 * float(plan.seen.heights.metres.max()) > top + 0.05 else ""
    return (
        "<div class='scale hidden' data-layer='heights'>"
        f"<span>0</span><i></i><span>{top / 2:g}</span><i></i><span>{top:g}{more} cm above the table</span></div>"
    )


def _segments(plan: Plan) -> str:
    by, colours = _by(plan), hexadecimal(plan.scene.garments)
    paths = outlines(plan.scene.segments + 1)
    # Below, the garments' own hues are replaced: a tint over another hue makes mud.
    hues = "".join(f"<path d='{path}' fill='{colour}'/>" for path, colour in zip(paths, colours, strict=False))
    drawn = [
        f"<path data-garment='{j}' data-by='{by[j]}' d='{path}' fill='{colour}' stroke='{colour}'>"
        f"<title>{escape(name)}: removed with probability {plan.coverage[j]:.2f}</title></path>"
        for j, (path, colour, name) in enumerate(zip(paths, colours, plan.scene.names, strict=False))
    ]
    return (
        f"<g data-layer='segments' class='hues' fill-rule='evenodd'>{hues}</g>"
        f"<g data-layer='segments' class='tints' fill-rule='evenodd'>{''.join(drawn)}</g>"
    )


def _parts(plan: Plan) -> str:
    found = partition(plan.scene, plan.sampling.reach)
    hidden = " hidden" if plan.scene.photo is not None else ""
    path = "".join(outlines(found.parts + 1)) if len(found) <= PARTS_LIMIT else ""
    return f"<path data-layer='parts' class='{hidden.strip()}' d='{path}'/>"


def _candidates(plan: Plan) -> str:
    poses = plan.instance.meta.poses
    points = np.unique(poses[:, :2], axis=0) if poses is not None and len(poses) else np.zeros((0, 2))
    hidden = "hidden" if plan.scene.photo is not None else ""
    dots = "".join(f"M{x:g} {y:g}h0" for x, y in points.tolist())
    return f"<g data-layer='candidates' class='{hidden}'><path class='rim' d='{dots}'/><path d='{dots}'/></g>"


def _region(plan: Plan) -> str:
    corners = [plan.seen.grid.from_photo(x, y) for x, y in plan.seen.roi]
    return f"<polygon class='roi' points='{' '.join(f'{x:.1f},{y:.1f}' for x, y in corners)}'/>" if corners else ""


def _ellipses(plan: Plan) -> str:
    height, width = plan.scene.shape
    radius = max(height, width) / 46
    drawn = "".join(_ellipse(plan, number, grasp, radius) for number, grasp in enumerate(plan.grasps, start=1))
    return f"<g data-layer='grasps' font-size='{1.25 * radius:.1f}'>{drawn}</g>"


def _ellipse(plan: Plan, number: int, grasp: Grasp, radius: float) -> str:
    (major, minor), (x, y) = plan.axes, plan.seen.grid.from_photo(grasp.x, grasp.y)
    to_x, to_y = plan.scene.basket
    what = ", ".join(f"{removal.name} {removal.probability:.2f}" for removal in grasp.removes)
    removes = " ".join(str(removal.garment) for removal in grasp.removes)
    return (
        f"<g class='grasp' tabindex='0' data-grasp='{number}' data-removes='{removes}'>"
        f"<title>grasp {number}: {escape(what)}</title>"
        f"<line class='way' x1='{x:.1f}' y1='{y:.1f}' x2='{to_x:.1f}' y2='{to_y:.1f}'/>"
        f"<g transform='translate({x:.1f} {y:.1f}) rotate({math.degrees(grasp.theta):.1f})'>"
        f"<ellipse class='halo' rx='{major / 2:.1f}' ry='{minor / 2:.1f}'/>"
        f"<ellipse rx='{major / 2:.1f}' ry='{minor / 2:.1f}'/>"
        f"<line x1='{-major / 2:.1f}' x2='{major / 2:.1f}' y1='0' y2='0'/></g>"
        f"<circle cx='{x:.1f}' cy='{y:.1f}' r='{radius:.1f}'/>"
        f"<text x='{x:.1f}' y='{y:.1f}' dy='.36em'>{number}</text></g>"
    )


def _basket(plan: Plan) -> str:
    (height, width), (x, y) = plan.scene.shape, plan.scene.basket
    side = max(height, width) / 38
    at_x, at_y = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
    where = "basket" if (at_x, at_y) == (x, y) else "towards the basket"
    turned = f"translate({at_x:.1f} {at_y:.1f}) rotate(45)"
    square = f"x='{-side / 2:.1f}' y='{-side / 2:.1f}' width='{side:.1f}' height='{side:.1f}' rx='{side / 8:.1f}'"
    return f"<g class='basket' data-layer='grasps' transform='{turned}'><title>{where}</title><rect {square}/></g>"


def _by(plan: Plan) -> list[str]:
    """For each garment, the numbers of the grasps that may remove it."""
    by: list[list[str]] = [[] for _ in range(plan.scene.garments)]
    for number, grasp in enumerate(plan.grasps, start=1):
        for removal in grasp.removes:
            by[removal.garment].append(str(number))
    return [" ".join(numbers) for numbers in by]


def _height(garment: GarmentHeight) -> str:
    return f"<small class='high'>{100 * garment.mean:.1f} cm high, top {100 * garment.top:.1f}</small>"


def _garments(plan: Plan) -> str:
    """A bar for each garment: how surely it is removed, and what is required."""
    rows, short, by = [], set(plan.unmet), _by(plan)
    areas = plan.scene.areas() / plan.scene.pixels_per_cm**2
    colours, heights = hexadecimal(plan.scene.garments), plan.seen.garment_heights
    for j, name in enumerate(plan.scene.names):
        high = "" if heights is None else _height(heights[j])
        required, covered = float(plan.instance.required[j]), float(plan.coverage[j])
        rows.append(
            f"<li tabindex='0' data-garment='{j}' data-by='{by[j]}'{' class=short' if j in short else ''}>"
            f"<svg class='swatch' viewBox='0 0 10 10'><circle cx='5' cy='5' r='5' fill='{colours[j]}'/></svg>"
            f"<span class='who'>{escape(name)}<small>{areas[j]:.0f} cm²</small>{high}</span>"
            "<svg class='bar' viewBox='0 0 100 10' preserveAspectRatio='none'><rect class='track' width='100' height='10'/>"
            f"<rect width='{100 * covered:.1f}' height='10' fill='{colours[j]}'/>"
            f"<rect class='tick' x='{100 * required - 0.5:.1f}' width='1.2' height='10'/></svg>"
            f"<span class='p'>{covered:.2f}</span></li>"
        )
    return "".join(rows) or "<li class='none'>nothing lies on the surface</li>"


def _grasps(plan: Plan) -> str:
    """A row for each grasp, in the order of execution."""
    rows, colours = [], hexadecimal(plan.scene.garments)
    scale = plan.seen.pixels_per_cm
    for number, grasp in enumerate(plan.grasps, start=1):
        removes = "".join(
            f"<span class='tag'><svg class='swatch' viewBox='0 0 10 10'><circle cx='5' cy='5' r='5' "
            f"fill='{colours[removal.garment]}'/></svg>{escape(removal.name)} <b>{removal.probability:.2f}</b></span>"
            for removal in grasp.removes
        )
        garments = " ".join(str(removal.garment) for removal in grasp.removes)
        rows.append(
            f"<tr tabindex='0' data-grasp='{number}' data-removes='{garments}'><td><b class='no'>{number}</b></td>"
            f"<td class='n'>{grasp.x:.0f}, {grasp.y:.0f}</td><td class='n'>{math.degrees(grasp.theta):.0f}°</td>"
            f"<td class='n'>{grasp.distance / scale:.0f}</td><td class='tags'>{removes}</td></tr>"
        )
    return "".join(rows) or "<tr><td colspan='5' class='none'>no grasp is planned</td></tr>"


def _stages(plan: Plan) -> str:
    """A bar for each stage's wall seconds."""
    stages = [(stage.name, stage.seconds) for stage in plan.seen.stages]
    stages += [("candidates", plan.seconds.candidates), ("solve", plan.seconds.solve)]
    longest = max(seconds for _, seconds in stages) or 1.0
    return "".join(
        f"<li><span>{escape(name)}</span><svg class='bar' viewBox='0 0 100 10' preserveAspectRatio='none'>"
        f"<rect class='track' width='100' height='10'/>"
        f"<rect class='time' width='{100 * seconds / longest:.1f}' height='10'/></svg>"
        f"<span class='p'>{seconds:.2f} s</span></li>"
        for name, seconds in stages
    )


def _facts(plan: Plan, verification: Verification) -> str:
    seen, result, (x, y) = plan.seen, plan.result, plan.seen.basket
    failed = [f"{check.what}: {check.detail}" for check in verification.checks if check.verdict is Verdict.FAILED]
    trusted = [check.detail for check in verification.checks if check.verdict is Verdict.UNCHECKED]
    rows = [
        ("input", seen.origin),
        *([("depth", seen.depth_origin)] if seen.heights is not None else []),
        ("file", plan.scene.source or "made in memory"),
        ("scale", f"{seen.pixels_per_cm:g} pixels per cm"),
        ("basket", f"x {x:.0f}, y {y:.0f}"),
        ("model", f"{result.formulation}, solved by {result.backend}, seed {result.settings.seed}"),
        ("status", str(plan.status)),
        ("scope", f"bound and status hold over {plan.scope}"),
        (
            "verified",
            f"FAILED: {'; '.join(failed)}" if failed else "coverage, requirements and objective, in exact arithmetic",
        ),
        *([("on trust", "; ".join(trusted))] if trusted else []),
        ("instance", plan.instance.digest),
    ]
    return "".join(f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in rows)

"""A plan as a JSON document, for the robot that executes it: schema "pscover.plan/1"."""

from __future__ import annotations

import math
from dataclasses import replace
from os import PathLike
from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct

from pscover.files import write_bytes
from pscover.grasps import Grasp
from pscover.instance import Instance
from pscover.perception.depth import HeightMap
from pscover.planning import Plan


class RemovalV1(Struct):
    """A garment and the probability that the grasp removes it."""

    garment: str
    label: int
    probability: float


class GraspV1(Struct):
    """A grasp: point in pixels of the photo and in centimetres from its top left pixel, angle in radians.

    `height_cm` is that of the cloth there above the table, null without depth.
    """

    x: float
    y: float
    x_cm: float
    y_cm: float
    theta: float
    basket_cm: float
    removes: list[RemovalV1]
    height_cm: float | None = None


class GarmentV1(Struct):
    """A garment: its name and label, q_j, how probably the plan removes it, and with depth its top and its mean height."""

    name: str
    label: int
    required: float
    coverage: float
    top_cm: float | None = None
    mean_cm: float | None = None


class DepthV1(Struct):
    """The depth image that was looked at: heights were measured from the plane 1/z = a + b x + c y, z in metres.

    `plane` is (a, b, c), found in the image if `fitted`; `intrinsics` are (fx, fy, cx, cy) or null; `spread_cm` is how flat
    the table was seen (null if no pixel lies near it), `holes` the share of pixels that were filled.
    """

    source: str
    metres_per_unit: float
    intrinsics: tuple[float, float, float, float] | None
    plane: tuple[float, float, float]
    fitted: bool
    spread_cm: float | None
    holes: float


class PlanV1(Struct, tag_field="schema", tag="pscover.plan/1"):
    """Grasps in order of execution, and what is known of them; a bound or objective that is not known is null.

    `status` and `bound` hold over `poses` poses: the drawn candidates if `candidates` is "sampled", every pose of the grid
    if it is "all". Everything is in pixels of the photo, or of the labels where there was no photo. `origin` says what was
    looked at, and how; `seconds` has wall seconds of every stage.
    """

    source: str
    origin: str
    instance: str
    width: int
    height: int
    pixels_per_cm: float
    basket: tuple[float, float]
    status: str
    stop: str
    formulation: str
    backend: str
    seed: int
    candidates: str
    poses: int
    bound: float | None
    expected_removed: float
    seconds: dict[str, float]
    grasps: list[GraspV1]
    garments: list[GarmentV1]
    unmet: list[str]
    depth: DepthV1 | None = None


def depth_document(heights: HeightMap) -> DepthV1:
    """What was used of a depth image."""
    camera, table = heights.camera, heights.table
    return DepthV1(
        source=heights.source,
        metres_per_unit=heights.metres_per_unit,
        intrinsics=None if camera is None else (camera.fx, camera.fy, camera.cx, camera.cy),
        plane=(table.offset, table.slope_x, table.slope_y),
        fitted=heights.fitted,
        spread_cm=100 * heights.spread if math.isfinite(heights.spread) else None,
        holes=heights.hole_share,
    )


def document(plan: Plan) -> PlanV1:
    """The plan in the form in which it is written."""
    seen, scene, result = plan.seen, plan.scene, plan.result
    height, width = seen.grid.photo_shape
    return PlanV1(
        source=scene.source,
        origin=seen.origin,
        instance=plan.instance.digest,
        width=width,
        height=height,
        pixels_per_cm=seen.pixels_per_cm,
        basket=seen.basket,
        status=str(plan.status),
        stop=str(result.stop),
        formulation=result.formulation,
        backend=result.backend,
        seed=result.settings.seed,
        candidates=plan.scope.candidates,
        poses=plan.scope.poses,
        bound=plan.bound if math.isfinite(plan.bound) else None,
        expected_removed=plan.expected_removed,
        seconds={
            **{stage.name: stage.seconds for stage in seen.stages},
            "candidates": plan.seconds.candidates,
            "solve": plan.seconds.solve,
        },
        grasps=[_grasp(plan, grasp) for grasp in plan.grasps],
        garments=_garments(plan),
        unmet=[scene.names[j] for j in plan.unmet],
        depth=None if seen.heights is None else depth_document(seen.heights),
    )


def _garments(plan: Plan) -> list[GarmentV1]:
    scene, heights = plan.scene, plan.seen.garment_heights
    garments = zip(scene.names, scene.values, plan.instance.required, plan.coverage, strict=True)
    rows = [GarmentV1(name, int(label), float(q), float(p)) for name, label, q, p in garments]
    for row, high in zip(rows, heights or (), strict=False):
        row.top_cm, row.mean_cm = 100 * high.top, 100 * high.mean
    return rows


def instance_of_photo(plan: Plan) -> Instance:
    """The plan's instance with its poses in pixels of the photo; the problem and its digest are the same."""
    poses = plan.instance.meta.poses
    if poses is None or plan.seen.grid.shape == plan.seen.grid.photo_shape:
        return plan.instance
    moved = np.array([(*plan.seen.grid.to_photo(x, y), theta) for x, y, theta in poses.tolist()]).reshape(-1, 3)
    moved.setflags(write=False)
    return replace(plan.instance, meta=replace(plan.instance.meta, poses=moved))


def encode_plan(plan: Plan) -> bytes:
    """The plan as JSON text in UTF-8, indented.

    Examples
    --------
    >>> import numpy as np
    >>> from pscover.planning import plan
    >>> text = encode_plan(plan(np.ones((40, 40), dtype=int)))
    >>> text[:30], text.count(b'"theta"')
    (b'{\\n  "schema": "pscover.plan/1"', 1)
    """
    return msgspec.json.format(msgspec.json.encode(document(plan)), indent=2) + b"\n"


def save_plan(plan: Plan, path: str | PathLike[str]) -> None:
    """Write the plan to a JSON file, whole or not at all.

    Raises
    ------
    PscoverError
        If the file cannot be written; an existing file is then as it was.
    """
    write_bytes(Path(path), encode_plan(plan))


def _grasp(plan: Plan, grasp: Grasp) -> GraspV1:
    scale, heights = plan.seen.pixels_per_cm, plan.seen.heights
    column, row = (round(value) for value in plan.seen.grid.from_photo(grasp.x, grasp.y))
    return GraspV1(
        x=grasp.x,
        y=grasp.y,
        x_cm=grasp.x / scale,
        y_cm=grasp.y / scale,
        theta=grasp.theta,
        basket_cm=grasp.distance / scale,
        removes=[
            RemovalV1(removed.name, int(plan.scene.values[removed.garment]), removed.probability)
            for removed in grasp.removes
        ],
        height_cm=None if heights is None else 100 * float(heights.metres[row, column]),
    )

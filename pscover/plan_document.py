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
from pscover.instance import Instance
from pscover.planning import Grasp, Plan


class RemovalV1(Struct):
    """A garment and the probability that the grasp removes it."""

    garment: str
    label: int
    probability: float


class GraspV1(Struct):
    """A grasp: point in pixels of the photo and in centimetres from its top left pixel, angle in radians."""

    x: float
    y: float
    x_cm: float
    y_cm: float
    theta: float
    basket_cm: float
    removes: list[RemovalV1]


class GarmentV1(Struct):
    """A garment: its name and label, q_j, and how probably the plan removes it."""

    name: str
    label: int
    required: float
    coverage: float


class PlanV1(Struct, tag_field="schema", tag="pscover.plan/1"):
    """Grasps in order of execution, and what is known of them; a bound or objective that is not known is null.

    Everything is in pixels of the photo, or of the labels where there was no photo. `origin` says what was looked at, and
    how; `seconds` has wall seconds of every stage.
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
    bound: float | None
    expected_removed: float
    seconds: dict[str, float]
    grasps: list[GraspV1]
    garments: list[GarmentV1]
    unmet: list[str]


def document(plan: Plan) -> PlanV1:
    """The plan in the form in which it is written."""
    seen, scene, result = plan.seen, plan.scene, plan.result
    height, width = seen.grid.photo_shape
    garments = zip(scene.names, scene.values, plan.instance.required, plan.coverage, strict=True)
    return PlanV1(
        source=scene.source,
        origin=seen.origin,
        instance=plan.instance.digest,
        width=width,
        height=height,
        pixels_per_cm=seen.pixels_per_cm,
        basket=seen.basket,
        status=str((plan.strict or result).status),
        stop=str(result.stop),
        formulation=result.formulation,
        backend=result.backend,
        seed=result.settings.seed,
        bound=plan.bound if math.isfinite(plan.bound) else None,
        expected_removed=plan.expected_removed,
        seconds={
            **{stage.name: stage.seconds for stage in seen.stages},
            "candidates": plan.seconds.candidates,
            "solve": plan.seconds.solve,
        },
        grasps=[_grasp(plan, grasp) for grasp in plan.grasps],
        garments=[GarmentV1(name, int(label), float(q), float(p)) for name, label, q, p in garments],
        unmet=[scene.names[j] for j in plan.unmet],
    )


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
    scale = plan.seen.pixels_per_cm
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
    )

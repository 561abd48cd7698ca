"""Events as JSON lines and image files, and back."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pscover.encoding import encode_labels, encode_photo
from pscover.errors import InvalidImage, InvalidResult
from pscover.execution.events import (
    Captured,
    Decided,
    Empty,
    Ended,
    Event,
    FrameLost,
    Judged,
    MotionFailed,
    Moved,
    PolicyFailed,
    Reason,
    Retried,
    ScaleDoubted,
)
from pscover.files import read_bytes, write_bytes
from pscover.images import read_labels, read_photo
from pscover.perception.grid import Grid
from pscover.policy import Action, Pick, Place, Skip, Transport
from pscover.robot import Frame, Pose
from pscover.scene import Scene
from pscover.seen import Seen

BYTE_LIMIT = 2**30
IMAGE = re.compile(r"[0-9]{6,}(\.labels\.png|\.depth\.npz|\.png)")
"""Names of a record's images, the number of their event first."""


def is_image(name: str) -> bool:
    """Whether a file's name is one that a record gives to its images.

    Examples
    --------
    >>> [is_image(name) for name in ("000012.png", "000012.depth.npz", "000012.labels.png", "12.png", "photo.png")]
    [True, True, True, False, False]
    """
    return IMAGE.fullmatch(name) is not None


def encoded(event: Event, folder: Path, number: int) -> dict[str, Any]:
    """The line of an event; its images are written to the folder first, named by `number`."""
    document: dict[str, Any] = {"event": type(event).__name__}
    match event:
        case Captured():
            document |= {"cloth": event.cloth, **_write_frame(event.frame, folder, number)}
        case Decided():
            document |= {
                "policy": event.policy,
                "actions": [_action(action) for action in event.actions],
                "skipped": [{**_pose(skip.pose), "change": skip.change} for skip in event.skipped],
                "seen": None if event.seen is None else _write_seen(event.seen, folder, number),
                "seconds": event.seconds,
            }
        case Moved():
            document |= {"action": _action(event.action), "weight": event.weight}
        case MotionFailed():
            document |= {"action": _action(event.action), "message": event.message}
        case Empty():
            document |= {"action": _action(event.pick)}
        case Judged():
            poses = [_pose(pose) for pose in event.poses]
            document |= {"poses": poses, "emptier": event.emptier, "changed": event.changed, "cloth": event.cloth}
        case Ended():
            document |= {"reason": str(event.reason), "message": event.message}
        case FrameLost() | PolicyFailed():
            document |= {"message": event.message}
        case Retried() | ScaleDoubted():
            pass
    return document


def decoded(document: dict[str, Any], folder: Path, place: str) -> Event:
    """The event of a line.

    Raises
    ------
    InvalidResult
        With `place`, if the line describes no event, or its images cannot be read.
    """
    try:
        return READERS[document["event"]](document, folder)
    except (KeyError, TypeError, ValueError, OverflowError) as problem:
        what = f"no {problem}" if isinstance(problem, KeyError) else str(problem)
        raise InvalidResult(f"{place}: expected an event, got {what}") from None


def _captured(document: dict[str, Any], folder: Path) -> Event:
    return Captured(frame=_read_frame(document, folder), cloth=int(document["cloth"]))


def _decided(document: dict[str, Any], folder: Path) -> Event:
    return Decided(
        policy=str(document["policy"]),
        actions=tuple(_read_action(action) for action in document["actions"]),
        skipped=tuple(Skip(pose=_read_pose(skip), change=float(skip["change"])) for skip in document["skipped"]),
        seen=None if document["seen"] is None else _read_seen(document["seen"], folder),
        plan=None,
        seconds=float(document["seconds"]),
    )


def _moved(document: dict[str, Any], folder: Path) -> Event:
    weight = document["weight"]
    return Moved(action=_read_action(document["action"]), weight=None if weight is None else float(weight))


def _failed(document: dict[str, Any], folder: Path) -> Event:
    return MotionFailed(action=_read_action(document["action"]), message=str(document["message"]))


def _empty(document: dict[str, Any], folder: Path) -> Event:
    pick = _read_action(document["action"])
    if not isinstance(pick, Pick):
        raise ValueError(f"an empty {pick}")
    return Empty(pick=pick)


def _judged(document: dict[str, Any], folder: Path) -> Event:
    poses = tuple(_read_pose(pose) for pose in document["poses"])
    emptier, changed = bool(document["emptier"]), bool(document["changed"])
    return Judged(poses=poses, emptier=emptier, changed=changed, cloth=int(document["cloth"]))


READERS: dict[str, Callable[[dict[str, Any], Path], Event]] = {
    "Captured": _captured,
    "Decided": _decided,
    "Moved": _moved,
    "MotionFailed": _failed,
    "Empty": _empty,
    "Judged": _judged,
    "FrameLost": lambda document, folder: FrameLost(message=str(document["message"])),
    "PolicyFailed": lambda document, folder: PolicyFailed(message=str(document["message"])),
    "Retried": lambda document, folder: Retried(),
    "ScaleDoubted": lambda document, folder: ScaleDoubted(),
    "Ended": lambda document, folder: Ended(reason=Reason(document["reason"]), message=str(document["message"])),
}


def _pose(pose: Pose) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y, "theta": pose.theta}


def _read_pose(document: dict[str, Any]) -> Pose:
    return Pose(x=float(document["x"]), y=float(document["y"]), theta=float(document["theta"]))


def _action(action: Action) -> dict[str, Any]:
    match action:
        case Pick():
            return {"action": "pick", **_pose(action.pose)}
        case Place():
            return {"action": "place", "x": action.x, "y": action.y}
        case Transport():
            return {"action": "transport", "basket": action.basket}


def _read_action(document: dict[str, Any]) -> Action:
    match document["action"]:
        case "pick":
            return Pick(pose=_read_pose(document))
        case "place":
            return Place(x=float(document["x"]), y=float(document["y"]))
        case "transport":
            return Transport(basket=str(document["basket"]))
        case other:
            raise ValueError(f"an action {other!r}")


def _write_frame(frame: Frame, folder: Path, number: int) -> dict[str, Any]:
    names: dict[str, Any] = {"image": f"{number:06d}.png", "depth": None}
    write_bytes(folder / names["image"], encode_photo(frame.rgb, ".png", "a record"))
    if frame.depth is not None:
        names["depth"] = f"{number:06d}.depth.npz"
        content = io.BytesIO()
        np.savez_compressed(content, metres=frame.depth)
        write_bytes(folder / names["depth"], content.getvalue())
    return names


def _read_frame(document: dict[str, Any], folder: Path) -> Frame:
    rgb = read_photo(_beside(folder, document["image"]))
    if document["depth"] is None:
        return Frame(rgb=rgb)
    path = _beside(folder, document["depth"])
    content = io.BytesIO(read_bytes(path, BYTE_LIMIT, InvalidResult))
    try:
        with np.load(content, allow_pickle=False) as archive:
            return Frame(rgb=rgb, depth=archive["metres"])
    except InvalidImage:
        raise
    except Exception as problem:
        raise InvalidResult(f"{path}: expected depth, got something damaged: {problem}") from None


def _write_seen(seen: Seen, folder: Path, number: int) -> dict[str, Any]:
    scene, name = seen.scene, f"{number:06d}.labels.png"
    write_bytes(folder / name, encode_labels(scene.segments + 1))
    return {
        "labels": name,
        "values": scene.values.tolist(),
        "names": list(scene.names),
        "pixels_per_cm": scene.pixels_per_cm,
        "basket": list(scene.basket),
        "photo_shape": list(seen.grid.photo_shape),
        "origin": seen.origin,
    }


def _read_seen(document: dict[str, Any], folder: Path) -> Seen:
    index = read_labels(_beside(folder, document["labels"]))
    values = np.array([0, *document["values"]], dtype=np.int32)
    if index.max(initial=0) >= len(values):
        raise ValueError("labels without values")
    x, y = document["basket"]
    scene = Scene.of(
        values[index],
        pixels_per_cm=float(document["pixels_per_cm"]),
        basket=(float(x), float(y)),
        names=document["names"],
    )
    height, width = document["photo_shape"]
    return Seen(scene=scene, grid=Grid(photo_shape=(height, width), shape=scene.shape), origin=str(document["origin"]))


def _beside(folder: Path, name: object) -> Path:
    """A file of the record; a name that leads out of its folder is none."""
    if not isinstance(name, str) or Path(name).name != name:
        raise ValueError(f"a file {name!r}")
    return folder / name

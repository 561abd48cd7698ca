"""Importing segment-anything where torchvision is missing or broken.

The package segment-anything imports four functions of torchvision: `batched_nms` and `box_area`, `resize` and
`to_pil_image`. The torchvision on PyPI is built for CUDA; next to a CPU build of torch it fails at import ("operator
torchvision::nms does not exist"). For that case alone this file has the four functions in plain torch and Pillow. They
stand in for torchvision while segment-anything is being imported, and are gone from `sys.modules` afterwards, so that no
other program mistakes them for torchvision. Where torchvision works, nothing happens.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from types import ModuleType
from typing import Any

from pscover.errors import MissingDependency

_lock = Lock()


def segment_anything() -> ModuleType:
    """The package segment-anything, imported with or without torchvision.

    Raises
    ------
    MissingDependency
        If segment-anything itself, or torch, is not installed.
    """
    try:
        with _lock:
            if "segment_anything" in sys.modules or torchvision_works():
                return importlib.import_module("segment_anything")
            with _stand_in():
                return importlib.import_module("segment_anything")
    except ModuleNotFoundError as error:
        if error.name not in ("segment_anything", "torch"):
            raise
        packages = {"segment_anything": "segment-anything", "torch": "torch"}
        raise MissingDependency.for_extra("segmenter 'sam'", [packages[error.name]], "sam") from None


def torchvision_works() -> bool:
    """Whether torchvision is installed and survives its import."""
    before = set(sys.modules)
    try:
        importlib.import_module("torchvision.ops.boxes")
        importlib.import_module("torchvision.transforms.functional")
    except (ImportError, RuntimeError, OSError, AttributeError):
        # A failed import leaves the submodules that did load; they would hide the stand-in.
        for name in set(sys.modules) - before:
            if name.split(".")[0] == "torchvision":
                del sys.modules[name]
        return False
    return True


@contextmanager
def _stand_in() -> Iterator[None]:
    modules = {
        "torchvision": ModuleType("torchvision"),
        "torchvision.ops": ModuleType("torchvision.ops"),
        "torchvision.ops.boxes": _module("torchvision.ops.boxes", batched_nms=batched_nms, box_area=box_area),
        "torchvision.transforms": ModuleType("torchvision.transforms"),
        "torchvision.transforms.functional": _module(
            "torchvision.transforms.functional", resize=resize, to_pil_image=to_pil_image
        ),
    }
    sys.modules.update(modules)
    try:
        yield
    finally:
        for name, module in modules.items():
            if sys.modules.get(name) is module:
                del sys.modules[name]


def _module(name: str, **members: Any) -> ModuleType:
    module = ModuleType(name)
    vars(module).update(members)
    return module


def box_area(boxes: Any) -> Any:
    """Areas of boxes (left, top, right, bottom), shape (n, 4) to (n,)."""
    return (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])


def batched_nms(boxes: Any, scores: Any, idxs: Any, iou_threshold: float) -> Any:
    """Greedy non-maximum suppression within each group: the indices kept, by descending score.

    Parameters
    ----------
    boxes
        (left, top, right, bottom), shape (n, 4).
    scores
        Shape (n,).
    idxs
        The group of each box, shape (n,); boxes of different groups do not suppress each other.
    iou_threshold
        A box goes if its intersection over union with a kept one exceeds this.
    """
    import torch

    order = torch.argsort(scores, descending=True, stable=True)
    # The published generator makes the groups on the CPU, wherever the boxes are.
    boxes, groups = boxes[order].float(), idxs.to(boxes.device)[order]
    areas = box_area(boxes)
    alive = torch.ones(len(order), dtype=torch.bool, device=boxes.device)
    for i in range(len(order)):
        if not alive[i]:
            continue
        corner = torch.maximum(boxes[i, :2], boxes[i + 1 :, :2])
        sides = (torch.minimum(boxes[i, 2:], boxes[i + 1 :, 2:]) - corner).clamp(min=0)
        common = sides[:, 0] * sides[:, 1]
        overlap = common / (areas[i] + areas[i + 1 :] - common)
        alive[i + 1 :] &= ~((overlap > iou_threshold) & (groups[i + 1 :] == groups[i]))
    return order[alive]


def to_pil_image(picture: Any) -> Any:
    """An array of shape (H, W, 3), uint8, as a Pillow image."""
    from PIL import Image

    return Image.fromarray(picture)


def resize(image: Any, size: tuple[int, int]) -> Any:
    """A Pillow image at a size (height, width), by bilinear interpolation with antialiasing, as torchvision does it."""
    from PIL import Image

    return image.resize((size[1], size[0]), Image.Resampling.BILINEAR)

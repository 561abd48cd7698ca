"""A model of segment-anything as a promptable model, on the CPU or with CUDA."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings, Refused
from pscover.perception.models import stamp
from pscover.perception.promptable import Decoded, Frame
from pscover.perception.sam_structure import load_sam
from pscover.perception.torchvision_stand_in import segment_anything


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TorchSam:
    """A `segment_anything.modeling.Sam`, in evaluation mode.

    Parameters
    ----------
    model
        The model, on its device.
    """

    model: Any

    @classmethod
    def load(cls, checkpoint: Path, device: str) -> TorchSam:
        """The model in a checkpoint; a second call with the same unchanged file and device costs nothing.

        Raises
        ------
        MissingDependency
            Without torch or segment-anything.
        InvalidImage
            If the file is no such checkpoint.
        InvalidSettings, Refused
            For an unknown device, and for one that is not there.
        """
        segment_anything()
        return _loaded(checkpoint, stamp(checkpoint), usable(device))

    def embed(self, photo: NDArray[np.uint8]) -> TorchPhoto:
        """Run the encoder."""
        import torch

        frame = Frame(height=photo.shape[0], width=photo.shape[1], side=self.model.image_encoder.img_size)
        with torch.inference_mode():
            square = torch.from_numpy(frame.square(photo)[None]).to(self.model.device)
            return TorchPhoto(model=self.model, frame=frame, embedding=_settled(self.model.image_encoder(square)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TorchPhoto:
    """A photo that the encoder has seen.

    Parameters
    ----------
    model
        Whose embedding it is.
    frame
        Where the photo lies in the square.
    embedding
        A tensor of shape (1, C, side / 16, side / 16).
    """

    model: Any
    frame: Frame
    embedding: Any

    def decode(self, points: NDArray[np.float64]) -> Decoded:
        """Run the prompt encoder and the mask decoder, each point a prompt of its own."""
        import torch

        prompts = torch.from_numpy(self.frame.in_square(points)[:, None]).to(self.model.device)
        labels = torch.ones(prompts.shape[:2], dtype=torch.int, device=self.model.device)
        with torch.inference_mode():
            sparse, dense = self.model.prompt_encoder(points=(prompts, labels), boxes=None, masks=None)
            low, iou = self.model.mask_decoder(
                image_embeddings=self.embedding,
                image_pe=self.model.prompt_encoder.get_dense_pe(),
                sparse_prompt_embeddings=sparse,
                dense_prompt_embeddings=dense,
                multimask_output=True,
            )
        rows, columns = self.frame.cells
        return Decoded(logits=low[:, :, :rows, :columns].cpu().numpy(), iou=iou.cpu().numpy())


def usable(device: str) -> str:
    """The device's name, if it is there: "cpu", "cuda" or "cuda:<number>", or "auto" for CUDA where there is any.

    Raises
    ------
    InvalidSettings
        For an unknown name.
    Refused
        If this build of torch or this machine has no such device.
    """
    import torch

    count = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if device == "auto":
        return "cuda" if count else "cpu"
    kind, _, number = device.partition(":")
    if device != "cpu" and not (kind == "cuda" and (number.isdecimal() or device == "cuda")):
        raise InvalidSettings(f'device: expected "cpu", "cuda", "cuda:<number>" or "auto", got {device!r}')
    if kind == "cuda" and int(number or 0) >= count:
        reason = (
            "this build of torch is for the CPU alone" if torch.version.cuda is None else f"torch sees {count} CUDA devices"
        )
        raise Refused(
            f"device {device!r}: {reason}; use device=cpu, or install torch for CUDA as pytorch.org/get-started says"
        )
    return device


@contextmanager
def torch_threads(threads: int) -> Iterator[None]:
    """Let torch use so many threads inside, and as many as before afterwards."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _settled(tensor: Any) -> Any:
    """The tensor once it is computed: CUDA answers before it has finished, and stage times would be wrong."""
    if tensor.is_cuda:
        import torch

        torch.cuda.synchronize(tensor.device)
    return tensor


@lru_cache(maxsize=2)
def _loaded(checkpoint: Path, _: tuple[int, int], device: str) -> TorchSam:
    return TorchSam(model=load_sam(checkpoint).to(device))

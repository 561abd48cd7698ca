"""A SAM-like model in two ONNX files, run by onnxruntime: no torch.

The encoder maps `x` (1, 3, side, side) to `emb`; the decoder maps `emb`, `pts` (B, 1, 2) in pixels of the square and `lab`
(B, 1), which is 1, to `low` (B, k, side / 4, side / 4) and `iou` (B, k). `pscover.perception.export` writes such files.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.errors import EngineFailed, InvalidImage, MissingDependency
from pscover.perception.models import stamp
from pscover.perception.promptable import Decoded, Frame

INPUTS = ("emb", "pts", "lab")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnnxSam:
    """Two sessions of onnxruntime.

    Parameters
    ----------
    encoder, decoder
        Sessions.
    side
        Of the encoder's square in pixels.
    """

    encoder: Any
    decoder: Any
    side: int

    @classmethod
    def load(cls, encoder: Path, decoder: Path, threads: int) -> OnnxSam:
        """The model in two files; a second call with the same unchanged files and threads costs nothing.

        Raises
        ------
        MissingDependency
            Without onnxruntime.
        InvalidImage
            If a file is no such model.
        """
        return _loaded(encoder, stamp(encoder), decoder, stamp(decoder), threads)

    def embed(self, photo: NDArray[np.uint8]) -> OnnxPhoto:
        """Run the encoder."""
        frame = Frame(height=photo.shape[0], width=photo.shape[1], side=self.side)
        (embedding,) = _run(self.encoder, {"x": frame.square(photo)[None]})
        return OnnxPhoto(model=self, frame=frame, embedding=embedding)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnnxPhoto:
    """A photo that the encoder has seen.

    Parameters
    ----------
    model
        Whose embedding it is.
    frame
        Where the photo lies in the square.
    embedding
        Shape (1, C, side / 16, side / 16).
    """

    model: OnnxSam
    frame: Frame
    embedding: NDArray[np.float32]

    def decode(self, points: NDArray[np.float64]) -> Decoded:
        """Run the decoder, each point a prompt of its own."""
        prompts = self.frame.in_square(points)[:, None]
        labels = np.ones((len(points), 1), dtype=np.float32)
        low, iou = _run(self.model.decoder, {"emb": self.embedding, "pts": prompts, "lab": labels})
        rows, columns = self.frame.cells
        return Decoded(logits=low[:, :, :rows, :columns], iou=iou)


def _run(session: Any, feed: dict[str, NDArray[Any]]) -> list[NDArray[np.float32]]:
    try:
        return [np.asarray(part, dtype=np.float32) for part in session.run(None, feed)]
    except Exception as error:
        # onnxruntime's own exceptions derive from RuntimeError or from Exception, by version.
        raise EngineFailed(f"onnxruntime: {error}") from None


@lru_cache(maxsize=2)
def _loaded(encoder: Path, _: tuple[int, int], decoder: Path, __: tuple[int, int], threads: int) -> OnnxSam:
    first, second = _session(encoder, threads), _session(decoder, threads)
    shape = first.get_inputs()[0].shape
    if len(first.get_inputs()) != 1 or len(shape) != 4 or shape[1] != 3 or shape[2] != shape[3]:
        raise InvalidImage(f"{encoder}: expected an encoder with one input (1, 3, side, side), got {shape}")
    names = tuple(each.name for each in second.get_inputs())
    if names != INPUTS:
        raise InvalidImage(f"{decoder}: expected a decoder with the inputs {', '.join(INPUTS)}, got {', '.join(names)}")
    return OnnxSam(encoder=first, decoder=second, side=int(shape[2]))


def _session(path: Path, threads: int) -> Any:
    try:
        import onnxruntime
    except ImportError:
        raise MissingDependency.for_extra("segmenter 'mobile-sam'", ["onnxruntime"], "mobile-sam") from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise InvalidImage(f"{path}: expected an ONNX model, got something else ({error})") from None

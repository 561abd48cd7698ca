"""Making ONNX files for the segmenter "mobile-sam" from a checkpoint of MobileSAM, or of any SAM.

The encoder becomes one file; the prompt encoder and the mask decoder another, for any number of points at a time. Both are
compared with the checkpoint's own answers before they are written, and entered into `SHA256SUMS` beside them, for their
digests depend on the version of torch.
"""

# torch is not looked into when types are checked: its classes are of no known type.
# mypy: disallow-subclassing-any=False

from __future__ import annotations

import io
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pscover.errors import EngineFailed, InvalidSettings, MissingDependency
from pscover.files import read_bytes, write_bytes
from pscover.perception.models import CATALOGUE, DECODER, ENCODER, SUMS, vouch, vouched
from pscover.perception.onnx_sam import OnnxSam
from pscover.perception.promptable import Decoded
from pscover.perception.torch_sam import TorchSam

OPERATORS = 17
"""Version of ONNX's operators; every onnxruntime since 1.12 (2022) has them."""
TOLERANCE = 1e-2
"""Logits run to tens, and are cut at 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Exported:
    """What was written.

    Parameters
    ----------
    encoder, decoder
        Paths of the files.
    difference
        The largest difference between logits of the files and of the checkpoint, on a random photo.
    """

    encoder: Path
    decoder: Path
    difference: float


def export(checkpoint: Path, folder: Path) -> Exported:
    """Write `mobile_sam_encoder.onnx` and `mobile_sam_decoder.onnx`, and vouch for them in `SHA256SUMS`.

    Parameters
    ----------
    checkpoint
        `mobile_sam.pt`, of a known digest or one vouched for.
    folder
        Where to; it is made if need be. Files of these names are replaced.

    Raises
    ------
    MissingDependency
        Without torch, segment-anything, onnx or onnxruntime.
    InvalidSettings
        If nobody vouches for the checkpoint.
    InvalidImage
        If it is none of a SAM model.
    EngineFailed
        If the files answer otherwise than the checkpoint.
    """
    known = tuple(digest for weights in CATALOGUE for digest in weights.digests)
    model = TorchSam.load(vouched(checkpoint, known), "cpu")
    encoder, decoder = _onnx(model.model)
    with tempfile.TemporaryDirectory() as trial:
        files = Path(trial, ENCODER.file), Path(trial, DECODER.file)
        for path, content in zip(files, (encoder, decoder), strict=True):
            path.write_bytes(content)
        difference = _difference(model, OnnxSam.load(*files, threads=1))
    if not difference <= TOLERANCE:
        raise EngineFailed(
            f"export: expected logits within {TOLERANCE} of the checkpoint's, got a difference of {difference:.3g}"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidSettings(f"{folder}: cannot be made: {error.strerror}") from None
    written = folder / ENCODER.file, folder / DECODER.file
    for path, content in zip(written, (encoder, decoder), strict=True):
        write_bytes(path, content)
    _enter(folder, written)
    return Exported(encoder=written[0], decoder=written[1], difference=difference)


def _enter(folder: Path, written: tuple[Path, ...]) -> None:
    """Bring `SHA256SUMS` up to date; lines of other files stay."""
    sums = folder / SUMS
    before = read_bytes(sums, 2**20, InvalidSettings).splitlines(keepends=True) if sums.exists() else []
    names = {path.name.encode() for path in written}
    others = [line for line in before if line.split()[-1:] and line.split()[-1].removeprefix(b"*") not in names]
    write_bytes(sums, b"".join([*others, *(vouch(path) for path in written)]))


def _onnx(sam: Any) -> tuple[bytes, bytes]:
    try:
        import onnx  # noqa: F401 - torch's exporter says nothing about the package it lacks
    except ImportError:
        raise MissingDependency.for_extra("exporting models", ["onnx"], "models") from None
    import torch

    side, width = sam.image_encoder.img_size, sam.prompt_encoder.embed_dim
    generator = torch.Generator().manual_seed(0)
    photo = torch.rand(1, 3, side, side, generator=generator)
    embedding = torch.rand(1, width, side // 16, side // 16, generator=generator)
    points = torch.rand(3, 1, 2, generator=generator) * side
    several = {name: {0: "points"} for name in ("pts", "lab", "low", "iou")}
    return (
        _traced(sam.image_encoder, (photo,), ["x"], ["emb"], {}),
        _traced(point_decoder(sam), (embedding, points, torch.ones(3, 1)), ["emb", "pts", "lab"], ["low", "iou"], several),
    )


def _traced(module: Any, example: tuple[Any, ...], inputs: list[str], outputs: list[str], several: dict[str, Any]) -> bytes:
    import torch

    content = io.BytesIO()
    with torch.no_grad(), warnings.catch_warnings():
        # Shapes that tracing takes for constants are constant here; the newer exporter would need a further package.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            module, example, content, input_names=inputs, output_names=outputs, dynamic_axes=several,
            opset_version=OPERATORS, dynamo=False,
        )  # fmt: skip
    return content.getvalue()


def point_decoder(sam: Any) -> Any:
    """Prompt encoder and mask decoder in one module: (embedding, points, labels) to (logits, iou).

    segment-anything embeds points by assignments under boolean masks, which fix the number of points when traced; the sums
    here say the same.
    """
    import torch

    class PointDecoder(torch.nn.Module):
        """One foreground point a prompt."""

        def __init__(self) -> None:
            super().__init__()
            self.sam = sam

        def forward(self, embedding: Any, points: Any, labels: Any) -> Any:
            """Shapes (1, C, s, s), (B, 1, 2), (B, 1) to (B, k, 4 s, 4 s), (B, k)."""
            prompt = self.sam.prompt_encoder
            padded = torch.cat([points + 0.5, torch.zeros_like(points)], dim=1)
            kind = torch.cat([labels, -torch.ones_like(labels)], dim=1)[..., None]
            place = prompt.pe_layer._pe_encoding(padded / self.sam.image_encoder.img_size)
            sparse = torch.where(kind == -1, torch.zeros_like(place), place)
            embeddings = (prompt.not_a_point_embed, *prompt.point_embeddings[:2])
            for value, each in zip((-1, 0, 1), embeddings, strict=True):
                sparse = sparse + (kind == value) * each.weight
            cells = prompt.image_embedding_size
            dense = prompt.no_mask_embed.weight.reshape(1, -1, 1, 1).expand(points.shape[0], -1, *cells)
            return self.sam.mask_decoder(
                image_embeddings=embedding,
                image_pe=prompt.get_dense_pe(),
                sparse_prompt_embeddings=sparse,
                dense_prompt_embeddings=dense,
                multimask_output=True,
            )

    return PointDecoder().eval()


def _difference(one: TorchSam, two: OnnxSam) -> float:
    random = np.random.default_rng(0)
    photo = random.integers(0, 256, (90, 120, 3)).astype(np.uint8)
    points = random.random((5, 2)) * (120, 90)
    answers: list[Decoded] = [model.embed(photo).decode(points) for model in (one, two)]
    return float(np.abs(answers[0].logits - answers[1].logits).max())

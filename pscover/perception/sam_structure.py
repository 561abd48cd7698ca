"""A SAM model of segment-anything, its structure read off its weights.

ViT-B, -L and -H, any smaller one of the same kind, and MobileSAM's TinyViT, which segment-anything does not have: see
`pscover.perception.tiny_vit`.
"""

from __future__ import annotations

import pickle
import re
import warnings
from functools import partial
from pathlib import Path
from typing import Any

from pscover.errors import InvalidImage
from pscover.perception.promptable import PIXEL_DEVIATION, PIXEL_MEAN
from pscover.perception.tiny_vit import MARK, tiny_vit
from pscover.perception.torchvision_stand_in import segment_anything

ENCODER = "image_encoder."
HEADS = 8
"""Attention heads of the mask decoder, as published; no entry of the weights tells."""


def load_sam(path: Path) -> Any:
    """The model in a checkpoint, as a `segment_anything.modeling.Sam` in evaluation mode on the CPU.

    Only tensors are read from the file: a checkpoint that asks for code to be run is refused.

    Raises
    ------
    MissingDependency
        Without torch or segment-anything.
    InvalidImage
        If the file is no such checkpoint.
    """
    segment_anything()
    import torch

    try:
        with warnings.catch_warnings():
            # Of files that are no checkpoints torch warns before it refuses them.
            warnings.simplefilter("ignore")
            state = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, ValueError, OSError, KeyError) as error:
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise InvalidImage(f"{path}: expected a SAM checkpoint of tensors, got something else ({reason})") from None
    try:
        return build_sam(state)
    except (LookupError, RuntimeError, AttributeError, TypeError, ValueError, ArithmeticError, AssertionError) as error:
        said = (str(error.args[0] if error.args else "").strip() or type(error).__name__).splitlines()[0]
        reason = f"{said} is missing" if isinstance(error, KeyError) and " " not in said else said
        raise InvalidImage(
            f"{path}: expected the weights of SAM ViT-B, -L, -H or MobileSAM, got others ({reason})"
        ) from None


def build_sam(state: dict[str, Any]) -> Any:
    """The model with these weights.

    Parameters
    ----------
    state
        Its tensors by name.

    Raises
    ------
    LookupError, RuntimeError, ValueError, AssertionError
        If the names or shapes are not those of a SAM model.
    """
    segment_anything()
    from segment_anything.modeling import MaskDecoder, PromptEncoder, Sam, TwoWayTransformer

    encoder = _encoder({name.removeprefix(ENCODER): value for name, value in state.items() if name.startswith(ENCODER)})
    width, given = state["mask_decoder.iou_token.weight"].shape[1], state[f"{ENCODER}neck.2.weight"].shape[0]
    if width != given:
        raise ValueError(f"the decoder takes {width} channels, the encoder gives {given}")
    rest = "mask_decoder."
    transformer = TwoWayTransformer(
        depth=_count(state, rest + "transformer.layers"),
        embedding_dim=width,
        num_heads=HEADS,
        mlp_dim=state[rest + "transformer.layers.0.mlp.lin1.weight"].shape[0],
    )
    model = Sam(
        image_encoder=encoder,
        prompt_encoder=PromptEncoder(
            embed_dim=width,
            image_embedding_size=(encoder.img_size // 16,) * 2,
            input_image_size=(encoder.img_size,) * 2,
            mask_in_chans=state["prompt_encoder.mask_downscaling.3.weight"].shape[0],
        ),
        mask_decoder=MaskDecoder(
            num_multimask_outputs=state[rest + "mask_tokens.weight"].shape[0] - 1,
            transformer=transformer,
            transformer_dim=width,
            iou_head_depth=_count(state, rest + "iou_prediction_head.layers"),
            iou_head_hidden_dim=state[rest + "iou_prediction_head.layers.0.weight"].shape[0],
        ),
        pixel_mean=list(PIXEL_MEAN),
        pixel_std=list(PIXEL_DEVIATION),
    )
    others = {name: value for name, value in state.items() if not name.startswith(ENCODER)}
    missing, unexpected = model.load_state_dict(others, strict=False)
    lost = [name for name in missing if not name.startswith((ENCODER, "pixel_"))]
    if lost or unexpected:
        raise KeyError(f"missing {lost[:3]}, unexpected {unexpected[:3]}")
    return model.eval()


def _encoder(state: dict[str, Any]) -> Any:
    """The image encoder with these weights: TinyViT or a plain vision transformer."""
    if MARK in state:
        return tiny_vit(state)
    import torch
    from segment_anything.modeling import ImageEncoderViT

    width, _, patch, _ = state["patch_embed.proj.weight"].shape
    cells = state["pos_embed"].shape[1]
    sides = [(len(state[f"blocks.{k}.attn.rel_pos_h"]) + 1) // 2 for k in range(_count(state, "blocks"))]
    windowed = [side for side in sides if side != cells]
    encoder = ImageEncoderViT(
        img_size=cells * patch,
        patch_size=patch,
        embed_dim=width,
        depth=len(sides),
        num_heads=width // state["blocks.0.attn.rel_pos_h"].shape[1],
        mlp_ratio=state["blocks.0.mlp.lin1.weight"].shape[0] / width,
        out_chans=state["neck.0.weight"].shape[0],
        norm_layer=partial(torch.nn.LayerNorm, eps=1e-6),
        use_rel_pos=True,
        # Attention is global where positions are relative to the whole photo.
        global_attn_indexes=tuple(k for k, side in enumerate(sides) if side == cells),
        window_size=windowed[0] if windowed else 0,
    )
    encoder.load_state_dict(state)
    return encoder


def _count(state: dict[str, Any], prefix: str) -> int:
    """How many numbered entries follow a prefix."""
    numbers = [int(found[1]) for name in state if (found := re.match(re.escape(prefix) + r"\.(\d+)\.", name))]
    if not numbers:
        raise KeyError(f"nothing named {prefix}.0")
    return 1 + max(numbers)

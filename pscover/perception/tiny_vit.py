"""The image encoder of MobileSAM, for inference: TinyViT, written from its papers.

A stem of two convolutions and four stages: one of inverted bottlenecks, three of windowed attention with a depthwise
convolution in between; then SAM's neck. Everything is a function of the weights, which are named as in `mobile_sam.pt`:
`conv1.c.weight` below `layers.0.blocks.1.` and so on. Sizes are read from them; what cannot be (the strides between stages)
is as published.

Source: Wu et al. 2022 (TinyViT, arXiv 2207.10666, section 3.3 and table 1); Zhang et al. 2023 (MobileSAM, arXiv
2306.14289), who take the stride of the last stage away so that the output is a sixteenth of the input.
"""

# torch is not looked into when types are checked: its classes are of no known type.
# mypy: disallow-subclassing-any=False

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import isqrt
from typing import Any

STRIDES = (2, 2, 1)
MARK = "patch_embed.seq.0.c.weight"
"""An encoder whose weights have this name is a TinyViT."""
UNUSED = ("norm_head.", "head.")
"""The classifier that TinyViT was trained with; it is in the file and of no use here."""
CHANNELS_EPSILON = 1e-6
SEPARATOR = "/"
"""torch does not allow dots in the names of a module's own tensors."""


def tiny_vit(state: dict[str, Any], img_size: int = 1024) -> Any:
    """The encoder as a `torch.nn.Module`: from a normalised photo (B, 3, S, S) to its embedding (B, C, S / 16, S / 16).

    Parameters
    ----------
    state
        Its weights, named as in `mobile_sam.pt` without the prefix "image_encoder.".
    img_size
        Side of the input in pixels.

    Raises
    ------
    KeyError, RuntimeError, ValueError
        If a weight is missing or has a shape that does not fit the others.
    """
    import torch

    used = {name: value for name, value in state.items() if not name.startswith(UNUSED)}

    class TinyViT(torch.nn.Module):
        """The weights, and what is computed from them."""

        def __init__(self) -> None:
            super().__init__()
            self.img_size = img_size
            for name, value in used.items():
                self.register_buffer(name.replace(".", SEPARATOR), value)

        def forward(self, x: Any) -> Any:
            """Embed photos."""
            weights = {name.replace(SEPARATOR, "."): value for name, value in self.named_buffers()}
            return _embed(x, Weights(weights))

    _check(used, img_size)
    return TinyViT().eval()


def _check(state: dict[str, Any], img_size: int) -> None:
    """Raise unless an image of that size goes through; on tensors that have shapes and no values, so at no cost."""
    import torch

    shapes = {name: torch.empty_like(value, device="meta") for name, value in state.items()}
    embedding = _embed(torch.empty((1, 3, img_size, img_size), device="meta"), Weights(shapes))
    side = img_size // 16
    if embedding.shape[2:] != (side, side):
        raise ValueError(f"an embedding of {side} x {side} expected, got {tuple(embedding.shape[2:])}")


@dataclass(frozen=True, slots=True)
class Weights:
    """Weights below a place in the network.

    Parameters
    ----------
    state
        All weights by name.
    here
        What the names of those below begin with.
    """

    state: dict[str, Any]
    here: str = ""

    def __getitem__(self, name: str) -> Any:
        if self.here + name not in self.state:
            raise KeyError(f"the weight {self.here}{name} is missing")
        return self.state[self.here + name]

    def __contains__(self, name: str) -> bool:
        return self.here + name in self.state

    def at(self, name: str) -> Weights:
        """Those below a place farther down."""
        return Weights(self.state, f"{self.here}{name}.")

    def numbered(self, name: str) -> list[Weights]:
        """Those below each of `name`.0, `name`.1, ..."""
        start = f"{self.here}{name}."
        numbers = {int(key.removeprefix(start).split(".")[0]) for key in self.state if key.startswith(start)}
        return [self.at(f"{name}.{number}") for number in range(len(numbers))]


def _embed(x: Any, w: Weights) -> Any:
    from torch.nn import functional

    x = functional.gelu(_normed(x, w.at("patch_embed.seq.0"), stride=2))
    x = _normed(x, w.at("patch_embed.seq.2"), stride=2)
    for number, stage in enumerate(w.numbered("layers")):
        for block in stage.numbered("blocks"):
            x = _bottleneck(x, block) if "conv1.c.weight" in block else _block(x, block)
        if "downsample.conv1.c.weight" in stage:
            x = _merge(x, stage.at("downsample"), STRIDES[number])
    x = _over_channels(functional.conv2d(x, w["neck.0.weight"]), w.at("neck.1"))
    return _over_channels(functional.conv2d(x, w["neck.2.weight"], padding=1), w.at("neck.3"))


def _normed(x: Any, w: Weights, stride: int = 1) -> Any:
    """A convolution and its batch normalisation; the weights' shape says whether it is depthwise."""
    from torch.nn import functional

    kernel = w["c.weight"]
    _, depth, side, _ = _sizes(kernel)
    x = functional.conv2d(x, kernel, stride=stride, padding=side // 2, groups=_sizes(x)[1] // depth)
    norm = w.at("bn")
    return functional.batch_norm(x, norm["running_mean"], norm["running_var"], norm["weight"], norm["bias"])


def _over_channels(x: Any, w: Weights) -> Any:
    """Layer normalisation over the channels of a (B, C, H, W) tensor."""
    return _layer_norm(x.permute(0, 2, 3, 1), w, CHANNELS_EPSILON).permute(0, 3, 1, 2)


def _layer_norm(x: Any, w: Weights, epsilon: float = 1e-5) -> Any:
    from torch.nn import functional

    return functional.layer_norm(x, _sizes(w["weight"]), w["weight"], w["bias"], epsilon)


def _linear(x: Any, w: Weights) -> Any:
    from torch.nn import functional

    return functional.linear(x, w["weight"], w["bias"])


def _bottleneck(x: Any, w: Weights) -> Any:
    """Widen, convolve each channel, narrow, add."""
    from torch.nn import functional

    inner = functional.gelu(_normed(x, w.at("conv1")))
    inner = functional.gelu(_normed(inner, w.at("conv2")))
    return functional.gelu(x + _normed(inner, w.at("conv3")))


def _merge(x: Any, w: Weights, stride: int) -> Any:
    """Between stages: another width and, by the stride, another resolution."""
    from torch.nn import functional

    x = functional.gelu(_normed(x, w.at("conv1")))
    return _normed(functional.gelu(_normed(x, w.at("conv2"), stride)), w.at("conv3"))


def _block(x: Any, w: Weights) -> Any:
    """Windowed attention, a depthwise convolution across the windows, a perceptron."""
    from torch.nn import functional

    x = x + _in_windows(x.permute(0, 2, 3, 1), w.at("attn")).permute(0, 3, 1, 2)
    x = _normed(x, w.at("local_conv"))
    inner = _linear(_layer_norm(x.permute(0, 2, 3, 1), w.at("mlp.norm")), w.at("mlp.fc1"))
    return x + _linear(functional.gelu(inner), w.at("mlp.fc2")).permute(0, 3, 1, 2)


def _in_windows(x: Any, w: Weights) -> Any:
    """Attention within square windows of a (B, H, W, C) tensor, padded to whole windows."""
    from torch.nn import functional

    batch, height, width, channels = _sizes(x)
    side = isqrt(_sizes(w["attention_biases"])[1])
    padded = functional.pad(x, (0, 0, 0, -width % side, 0, -height % side))
    rows, columns = padded.shape[1] // side, padded.shape[2] // side
    windows = padded.view(batch, rows, side, columns, side, channels).transpose(2, 3)
    mixed = _attend(windows.reshape(-1, side * side, channels), w, side)
    tiles = mixed.view(batch, rows, columns, side, side, channels).transpose(2, 3)
    return tiles.reshape(batch, rows * side, columns * side, channels)[:, :height, :width]


def _attend(x: Any, w: Weights, side: int) -> Any:
    """Attention over (windows, places, C), with a learned bias for each distance (|dy|, |dx|)."""
    windows, places, width = _sizes(x)
    heads = _sizes(w["attention_biases"])[0]
    parts = _linear(_layer_norm(x, w.at("norm")), w.at("qkv")).view(windows, places, heads, 3, width // heads)
    query, key, value = parts.permute(3, 0, 2, 1, 4)
    scores = (query * (width // heads) ** -0.5) @ key.transpose(-2, -1) + w["attention_biases"][:, _distances(side)]
    mixed = scores.softmax(dim=-1) @ value
    return _linear(mixed.transpose(1, 2).reshape(windows, places, width), w.at("proj"))


def _sizes(x: Any) -> tuple[int, ...]:
    """A tensor's shape in whole numbers: while the network is traced for export, torch has tensors in their place."""
    return tuple(map(int, x.shape))


def _distances(side: int) -> Any:
    """Which bias stands for the distance of each two places of a window, shape (side^2, side^2).

    Biases are stored in the order in which their distances are met from the first place on, which is that of the places.
    """
    import torch

    places = list(product(range(side), repeat=2))
    return torch.tensor([[side * abs(a - c) + abs(b - d) for c, d in places] for a, b in places])

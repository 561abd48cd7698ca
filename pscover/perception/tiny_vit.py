"""The image encoder of MobileSAM, for inference: TinyViT, written from its papers.

A stem of two convolutions and four stages: one of inverted bottlenecks, three of windowed attention with a depthwise
convolution in between; then SAM's neck. The names of the parameters are those in `mobile_sam.pt`, so that its state loads
as it is. Sizes are read from the state; what cannot be read from it (window sides, the strides between stages) is as
published.

Source: Wu et al. 2022 (TinyViT, arXiv 2207.10666, section 3.3 and table 1); Zhang et al. 2023 (MobileSAM, arXiv
2306.14289), who take the stride of the last stage away so that the output is a sixteenth of the input.
"""

# torch is not looked into when types are checked: its classes are of no known type.
# mypy: disallow-subclassing-any=False

from __future__ import annotations

from itertools import product
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

STRIDES = (2, 2, 1)
STATE = "patch_embed.seq.0.c.weight"
"""An encoder state with this entry is TinyViT's."""


class Normed(nn.Sequential):
    """A convolution `c` and its batch normalisation `bn`, without an activation."""

    def __init__(self, inside: int, outside: int, kernel: int = 1, stride: int = 1, groups: int = 1) -> None:
        super().__init__()
        self.add_module("c", nn.Conv2d(inside, outside, kernel, stride, kernel // 2, groups=groups, bias=False))
        self.add_module("bn", nn.BatchNorm2d(outside))


class Stem(nn.Module):
    """Two strided convolutions: a quarter of the resolution."""

    def __init__(self, narrow: int, wide: int) -> None:
        super().__init__()
        self.seq = nn.Sequential(Normed(3, narrow, 3, 2), nn.GELU(), Normed(narrow, wide, 3, 2))

    def forward(self, x: Tensor) -> Tensor:
        """From (B, 3, H, W) to (B, wide, H / 4, W / 4)."""
        return self.seq(x)


class Bottleneck(nn.Module):
    """An inverted bottleneck: widen, convolve each channel, narrow, add."""

    def __init__(self, width: int, hidden: int) -> None:
        super().__init__()
        self.conv1 = Normed(width, hidden)
        self.conv2 = Normed(hidden, hidden, 3, groups=hidden)
        self.conv3 = Normed(hidden, width)

    def forward(self, x: Tensor) -> Tensor:
        """Shape (B, C, H, W) is kept."""
        inner = functional.gelu(self.conv2(functional.gelu(self.conv1(x))))
        return functional.gelu(x + self.conv3(inner))


class Merging(nn.Module):
    """Between stages: another width and, by the stride, another resolution."""

    def __init__(self, inside: int, outside: int, stride: int) -> None:
        super().__init__()
        self.conv1 = Normed(inside, outside)
        self.conv2 = Normed(outside, outside, 3, stride, groups=outside)
        self.conv3 = Normed(outside, outside)

    def forward(self, x: Tensor) -> Tensor:
        """From (B, inside, H, W) to (B, outside, H / stride, W / stride)."""
        return self.conv3(functional.gelu(self.conv2(functional.gelu(self.conv1(x)))))


class Attention(nn.Module):
    """Attention within a window, with a learned bias for each distance (|dy|, |dx|)."""

    def __init__(self, width: int, heads: int, side: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.LayerNorm(width)
        self.qkv = nn.Linear(width, 3 * width)
        self.proj = nn.Linear(width, width)
        self.attention_biases = nn.Parameter(torch.zeros(heads, side * side))
        places = list(product(range(side), repeat=2))
        # Biases are stored in the order in which their distances first appear, which is that of the first row.
        rank = {place: k for k, place in enumerate(places)}
        between = [[rank[abs(a[0] - b[0]), abs(a[1] - b[1])] for b in places] for a in places]
        self.register_buffer("between", torch.tensor(between), persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        """Shape (windows, places, C) is kept."""
        windows, places, width = x.shape
        parts = self.qkv(self.norm(x)).view(windows, places, self.heads, 3, width // self.heads)
        query, key, value = parts.permute(3, 0, 2, 1, 4)
        bias = self.attention_biases[:, self.between]
        scores = (query * (width // self.heads) ** -0.5) @ key.transpose(-2, -1) + bias
        mixed = scores.softmax(dim=-1) @ value
        return self.proj(mixed.transpose(1, 2).reshape(windows, places, width))


class Perceptron(nn.Module):
    """Two layers, normalised before."""

    def __init__(self, width: int, hidden: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.fc1 = nn.Linear(width, hidden)
        self.fc2 = nn.Linear(hidden, width)

    def forward(self, x: Tensor) -> Tensor:
        """Shape (..., C) is kept."""
        return self.fc2(functional.gelu(self.fc1(self.norm(x))))


class Block(nn.Module):
    """Windowed attention, a depthwise convolution across the windows, a perceptron."""

    def __init__(self, width: int, heads: int, side: int, hidden: int) -> None:
        super().__init__()
        self.side = side
        self.attn = Attention(width, heads, side)
        self.local_conv = Normed(width, width, 3, groups=width)
        self.mlp = Perceptron(width, hidden)

    def forward(self, x: Tensor) -> Tensor:
        """Shape (B, C, H, W) is kept."""
        x = x + self._attend(x.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
        x = self.local_conv(x)
        return x + self.mlp(x.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)

    def _attend(self, x: Tensor) -> Tensor:
        batch, height, width, channels = x.shape
        side = self.side
        padded = functional.pad(x, (0, 0, 0, -width % side, 0, -height % side))
        rows, columns = padded.shape[1] // side, padded.shape[2] // side
        windows = padded.view(batch, rows, side, columns, side, channels).transpose(2, 3)
        mixed = self.attn(windows.reshape(-1, side * side, channels))
        tiles = mixed.view(batch, rows, columns, side, side, channels).transpose(2, 3)
        return tiles.reshape(batch, rows * side, columns * side, channels)[:, :height, :width]


class Stage(nn.Module):
    """Blocks, and what leads to the next stage."""

    def __init__(self, blocks: list[nn.Module], downsample: nn.Module | None) -> None:
        super().__init__()
        self.blocks = nn.Sequential(*blocks)
        self.downsample = downsample if downsample is not None else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        """From (B, C, H, W) to the next stage's shape."""
        return self.downsample(self.blocks(x))


class ChannelNorm(nn.Module):
    """Layer normalisation over the channels of a (B, C, H, W) tensor."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.ones(width))
        self.bias = nn.Parameter(torch.zeros(width))

    def forward(self, x: Tensor) -> Tensor:
        """Shape (B, C, H, W) is kept."""
        normed = functional.layer_norm(x.permute(0, 2, 3, 1), self.weight.shape, self.weight, self.bias, 1e-6)
        return normed.permute(0, 3, 1, 2)


class TinyViT(nn.Module):
    """MobileSAM's image encoder.

    Parameters
    ----------
    state
        Its parameters, named as in `mobile_sam.pt` without the prefix "image_encoder.". They are loaded.
    img_size
        Side of the input in pixels.
    """

    def __init__(self, state: dict[str, Tensor], img_size: int = 1024) -> None:
        super().__init__()
        self.img_size = img_size
        self.patch_embed = Stem(state[STATE].shape[0], state["patch_embed.seq.2.c.weight"].shape[0])
        self.layers = nn.Sequential(*(_stage(state, k) for k in range(len(STRIDES) + 1)))
        wide, out = state["neck.0.weight"].shape[1], state["neck.0.weight"].shape[0]
        self.neck = nn.Sequential(
            nn.Conv2d(wide, out, 1, bias=False),
            ChannelNorm(out),
            nn.Conv2d(out, out, 3, padding=1, bias=False),
            ChannelNorm(out),
        )
        # The classifier's head that TinyViT was trained with is in the file and of no use here.
        used = {name: value for name, value in state.items() if not name.startswith(("norm_head.", "head."))}
        self.load_state_dict(used)

    def forward(self, x: Tensor) -> Tensor:
        """From a normalised photo (B, 3, S, S) to its embedding (B, C, S / 16, S / 16)."""
        return self.neck(self.layers(self.patch_embed(x)))


def _stage(state: dict[str, Tensor], k: int) -> Stage:
    here = f"layers.{k}."
    depth = 1 + max(int(name.split(".")[3]) for name in state if name.startswith(here + "blocks."))
    blocks = [_block(state, f"{here}blocks.{b}.") for b in range(depth)]
    onward = state.get(here + "downsample.conv1.c.weight")
    merging = None if onward is None else Merging(onward.shape[1], onward.shape[0], STRIDES[k])
    return Stage(blocks, merging)


def _block(state: dict[str, Tensor], here: str) -> nn.Module:
    expanding: Any = state.get(here + "conv1.c.weight")
    if expanding is not None:
        return Bottleneck(expanding.shape[1], expanding.shape[0])
    heads, places = state[here + "attn.attention_biases"].shape
    hidden, width = state[here + "mlp.fc1.weight"].shape
    return Block(width, heads, round(places**0.5), hidden)

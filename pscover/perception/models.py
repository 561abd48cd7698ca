"""Where weights of SAM-like models are looked for, and the digests they must have.

Weights are neither shipped nor downloaded. A file is used only if its SHA-256 digest is one that pscover knows, or one
that its owner vouches for by a line in a file `SHA256SUMS` in the same folder, as `sha256sum` writes it:

    sha256sum my_encoder.onnx my_decoder.onnx >> SHA256SUMS

That is the way for weights of one's own, and how files exported by `pscover.perception.export` come to be trusted.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from pscover.errors import InvalidSettings
from pscover.files import opened, read_bytes

FOLDER_VARIABLE = "PSCOVER_MODELS"
SUMS = "SHA256SUMS"
WEIGHTS_LIMIT = 2**33
"""No file of weights above 8 GiB is read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """A file of weights by its usual name.

    Parameters
    ----------
    file
        Its name.
    digests
        The SHA-256 digests that it may have.
    origin
        What it is and where it comes from, for whoever has not got it.
    made_from
        The weights from which `pscover models export` makes it; None for those that are published.
    """

    file: str
    digests: tuple[str, ...]
    origin: str
    made_from: Weights | None = None

    @property
    def advice(self) -> str:
        """How to come by it."""
        if self.made_from is None:
            return f"It is {self.origin}, SHA-256 {' or '.join(self.digests)}"
        source = self.made_from
        return (
            f"Make it with `pscover models export FOLDER/{source.file}`: that file is {source.origin}, "
            f"SHA-256 {' or '.join(source.digests)}"
        )


MOBILE_SAM = Weights(
    file="mobile_sam.pt",
    digests=("6dbb90523a35330fedd7f1d3dfc66f995213d81b29a5ca8108dbcdd4e37d6c2f",),
    origin="the official MobileSAM weights (Apache-2.0), weights/mobile_sam.pt of github.com/ChaoningZhang/MobileSAM",
)
_EXPORTED = f"what `pscover models export` makes of {MOBILE_SAM.file}"
ENCODER = Weights(
    file="mobile_sam_encoder.onnx",
    digests=("f516d0a4ab5a825f0cc8b282365519404bf9317ba6a990476bcec7728a3d0bf2",),
    origin=_EXPORTED,
    made_from=MOBILE_SAM,
)
DECODER = Weights(
    file="mobile_sam_decoder.onnx",
    digests=("383269c7b6794beb092be7a4a1a49e03ed32acd69d3c572a250cced94529536b",),
    origin=_EXPORTED,
    made_from=MOBILE_SAM,
)
_META = "official weights of Segment Anything (Apache-2.0), see the README of github.com/facebookresearch/segment-anything"
VIT_B = Weights(
    file="sam_vit_b_01ec64.pth",
    digests=("ec2df62732614e57411cdcf32a23ffdf28910380d03139ee0f4fcbe91eb8c912",),
    origin=_META,
)
VIT_L = Weights(
    file="sam_vit_l_0b3195.pth",
    digests=("3adcc4315b642a4d2101128f611684e8734c41232a17c648ed1693702a49a622",),
    origin=_META,
)
VIT_H = Weights(
    file="sam_vit_h_4b8939.pth",
    digests=("a7bf3b02f3ebf1267aba913ff637d9a2d5c33d3173bb679e46d9f338c26f262e",),
    origin=_META,
)
CATALOGUE = (MOBILE_SAM, ENCODER, DECODER, VIT_B, VIT_L, VIT_H)


def folders() -> tuple[Path, ...]:
    """Where weights are looked for, in this order: $PSCOVER_MODELS if set, ./models, ~/.cache/pscover."""
    asked = os.environ.get(FOLDER_VARIABLE)
    return (*([Path(asked)] if asked else []), Path("models"), Path.home() / ".cache" / "pscover")


def find(weights: Weights) -> Path | None:
    """The first file of that name in `folders`, or None; its content is not looked at."""
    return next((folder / weights.file for folder in folders() if (folder / weights.file).is_file()), None)


def locate(weights: Weights, given: str = "") -> Path:
    """The path of weights that may be used: those given, or those found in `folders`.

    Parameters
    ----------
    weights
        Which.
    given
        A path to use instead of looking for the usual name.

    Raises
    ------
    InvalidSettings
        If there is no such file, with where it was looked for and where it comes from; or if nobody vouches for its
        digest.
    """
    path = Path(given).expanduser() if given else find(weights)
    if path is None:
        looked = ", ".join(map(str, folders()))
        raise InvalidSettings(
            f"{weights.file}: not found in {looked}. {weights.advice}. The file goes into one of these "
            f"folders; or set {FOLDER_VARIABLE} to its own, or give its path. Nothing is downloaded"
        )
    return vouched(path, weights.digests)


def vouched(path: Path, digests: tuple[str, ...]) -> Path:
    """The path, if the file's digest is among `digests` or vouched for by `SHA256SUMS` beside it.

    Raises
    ------
    InvalidSettings
        If not, or if the file cannot be read.
    """
    got = digest(path)
    if got in digests or got in _sums(path):
        return path
    raise InvalidSettings(
        f"{path}: expected SHA-256 {' or '.join(digests)}, got {got}: the file is damaged or another one. If these are "
        f"weights of your own that you trust, vouch for them: cd {path.parent} && sha256sum {path.name} >> {SUMS}"
    )


def vouch(path: Path) -> bytes:
    """The line of `SHA256SUMS` for a file, as `sha256sum` writes it."""
    return f"{digest(path)}  {path.name}\n".encode()


def digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal; read again only when its size or time of change differ.

    Raises
    ------
    InvalidSettings
        If the file cannot be read.
    """
    return _digest(path.resolve(), stamp(path))


def stamp(path: Path) -> tuple[int, int]:
    """Size in bytes and time of change in nanoseconds: what tells one content of a file from the next.

    Raises
    ------
    InvalidSettings
        If the file is missing or is none.
    """
    with opened(path, WEIGHTS_LIMIT, InvalidSettings) as file:
        status = os.fstat(file.fileno())
    return status.st_size, status.st_mtime_ns


@lru_cache(maxsize=32)
def _digest(path: Path, _: tuple[int, int]) -> str:
    with opened(path, WEIGHTS_LIMIT, InvalidSettings) as file:
        whole = hashlib.sha256()
        while part := file.read(2**20):
            whole.update(part)
    return whole.hexdigest()


def _sums(path: Path) -> set[str]:
    """The digests that the owner of the folder vouches for under the file's name."""
    sums = path.parent / SUMS
    if not sums.is_file():
        return set()
    lines = read_bytes(sums, 2**20, InvalidSettings).decode("utf-8", "replace").splitlines()
    parts = [line.split(maxsplit=1) for line in lines]
    return {part[0].lower() for part in parts if len(part) == 2 and part[1].removeprefix("*") == path.name}

"""Scenes on disk: one file a seed, of one version of settings and physics."""

from __future__ import annotations

import ast
import hashlib
import io
import zipfile
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pscover.errors import PscoverError
from pscover.files import read_bytes, write_bytes
from pscover.sim.cloth import Cloth, FloatArray
from pscover.sim.settings import WorldSettings

PHYSICS = (
    "arm",
    "cloth",
    "contact",
    "fingers",
    "grip",
    "mesh",
    "pour",
    "robot",
    "step",
    "surface",
    "view",
    "wardrobe",
    "world",
)
"""Modules that decide how a scene comes out."""
LIMIT = 2**24


@cache
def _code() -> bytes:
    """A digest of what those modules do, whatever their comments say."""
    digest = hashlib.sha256()
    for name in PHYSICS:
        tree = ast.parse((Path(__file__).parent / f"{name}.py").read_bytes())
        for node in ast.walk(tree):
            # Docstrings, and the words below constants.
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                node.value.value = None
        digest.update(ast.dump(tree).encode())
    return digest.digest()


def version(settings: WorldSettings) -> str:
    """Sixteen hexadecimal digits that change with everything on which a scene depends, apart from its seed."""
    chosen = (settings.material, settings.gripper, settings.pour, settings.basket, settings.sensor.height)
    return hashlib.sha256(repr(chosen).encode() + _code()).hexdigest()[:16]


def path(folder: Path, seed: int, settings: WorldSettings) -> Path:
    """Where the scene of a seed is kept."""
    return folder / f"scene-{version(settings)}-{seed}.npz"


class Rest(NamedTuple):
    """A scene at rest: the arrays of `pscover.sim.cloth.Cloth` that tell one from another."""

    position: FloatArray
    hinge_length: FloatArray

    @classmethod
    def of(cls, cloth: Cloth) -> Rest:
        """As the cloth lies now."""
        return cls(cloth.position.copy(), cloth.hinge_length.copy())

    def restore(self, cloth: Cloth) -> None:
        """Lay fresh cloth of the same settings like this."""
        cloth.position[:] = cloth.before[:] = cloth.anchor[:] = self.position
        cloth.hinge_length[:] = self.hinge_length


def save(rest: Rest, path: Path) -> None:
    """Write a scene.

    Raises
    ------
    PscoverError
        If the file cannot be written.
    """
    buffer = io.BytesIO()
    np.savez_compressed(buffer, position=rest.position, hinge_length=rest.hinge_length)
    write_bytes(path, buffer.getvalue())


def load(path: Path) -> Rest | None:
    """Read a scene; None if it is not there.

    Raises
    ------
    PscoverError
        If the file is damaged.
    """
    if not path.exists():
        return None
    try:
        with np.load(io.BytesIO(read_bytes(path, LIMIT, PscoverError)), allow_pickle=False) as stored:
            return Rest(stored["position"], stored["hinge_length"])
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as problem:
        raise PscoverError(f"{path}: expected a scene of this version, got {problem}; delete the file") from None

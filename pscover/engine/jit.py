"""How kernels are compiled: to machine code when first called, kept on disk, typed as the Python that they are.

Compiling takes time for each expression, above all for each place of an array, and for each combination of argument types.
So kernels read a place once, get the room that they need from their callers, and are called with one type each.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

try:
    from numba import njit
except ImportError:  # Without numba the kernels are plain Python: slow and right.
    njit = None


def _options() -> dict[str, Any]:
    """How everything is compiled: without what only other compiled code could call."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    try:
        from numba.core.cpu import CPUTargetOptions
    except ImportError:
        return options
    if hasattr(CPUTargetOptions, "_nrt"):
        # Kernels get all arrays from their callers and make none: counting references would be a third of their code.
        options["_nrt"] = False
    return options


OPTIONS = _options()

F = TypeVar("F", bound=Callable[..., Any])

wide: Callable[[Any], int] = cast(Any, np.int64)
"""A whole number of 64 bits: functions that also get one of 32 bits, or a literal one, are compiled once more for it."""


def kernel(function: F) -> F:
    """Compile on first call and keep the result on disk beside the source, or in the user's cache folder."""
    if njit is None:
        return function
    compiled = njit(cache=True, **OPTIONS)(function)
    # Numba looks for edits in the kernel's own file only; what it calls may have changed as well.
    with contextlib.suppress(AttributeError):
        compiled._cache._cache_file._source_stamp = sources()
    return cast(F, compiled)


@cache
def sources() -> str:
    """A digest of the sources of all kernels: what was compiled from others is not used."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        text = path.read_bytes()
        if b"from .jit import" in text or path.name == "problem.py":
            digest.update(text)
    return digest.hexdigest()


def inner(function: F) -> F:
    """Compile as a part of the kernels that call it."""
    return function if njit is None else cast(F, njit(no_cpython_wrapper=True, **OPTIONS)(function))


@inner
def copy(target: NDArray[np.float64], source: NDArray[np.float64]) -> None:
    """Copy numbers one by one: as a slice it would take seconds to compile, for the words of an error that cannot occur."""
    for k in range(len(target)):
        target[k] = source[k]

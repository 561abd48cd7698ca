"""How kernels are compiled: to machine code when first called, kept on disk, typed as the Python that they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

try:
    from numba import njit
except ImportError:  # Without numba the kernels are plain Python: slow and right.
    njit = None

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile on first call and keep the result on disk beside the source, or in the user's cache folder."""
    return function if njit is None else cast(F, njit(cache=True, nogil=True, error_model="numpy")(function))


def inner(function: F) -> F:
    """Compile as a part of the kernels that call it."""
    return (
        function
        if njit is None
        else cast(F, njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(function))
    )


@inner
def copy(target: NDArray[np.float64], source: NDArray[np.float64]) -> None:
    """Copy numbers one by one: as a slice it would take seconds to compile, for the words of an error that cannot occur."""
    for k in range(len(target)):
        target[k] = source[k]

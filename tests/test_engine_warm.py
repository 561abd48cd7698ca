"""Getting kernels ready: every one of them belongs to a part that is compiled ahead."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any

import pytest

pytest.importorskip("numba")

from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher

import pscover.engine
from pscover.engine import warm


def test_every_kernel_is_in_one_part() -> None:
    modules = [
        importlib.import_module(module.name) for module in pkgutil.iter_modules(pscover.engine.__path__, "pscover.engine.")
    ]
    compiled: list[Any] = [value for module in modules for value in vars(module).values() if isinstance(value, Dispatcher)]
    kernels = {
        f"{function.__module__}.{function.__name__}" for function in compiled if isinstance(function._cache, FunctionCache)
    }
    ahead = [f"{kernel.__module__}.{kernel.__name__}" for part in warm._parts() for kernel in part.kernels]
    assert len(warm._parts()) == warm.PARTS
    assert sorted(ahead) == sorted(kernels)


def test_what_a_part_calls_compiles_all_its_kernels() -> None:
    warm.prepare()
    for part in warm._parts():
        for kernel in part.kernels:
            assert len(kernel.signatures) == 1, kernel.__name__
    assert warm.is_on_disk()

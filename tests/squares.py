"""A tiny sweep, for the tests of sweeps; imported by worker processes from here. As a program it runs it in a folder."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

from pscover.evidence.executors import processes
from pscover.evidence.sweep import Done, Store, Sweep, run_sweep


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """What to square, and how long to take."""

    value: int
    seconds: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Square:
    """Of a number; no root where it is negative."""

    square: int
    root: float | None


def square(case: Number) -> Done[Square, float]:
    """Of the case; 13 is not squared."""
    began = time.perf_counter()
    time.sleep(case.seconds)
    if case.value == 13:
        raise ArithmeticError("13 is not squared")
    row = Square(square=case.value**2, root=case.value**0.5 if case.value >= 0 else None)
    return Done(row=row, timing=time.perf_counter() - began)


SQUARES: Sweep[Number, Square, float] = Sweep(
    name="squares", run=square, case=Number, row=Square, timing=float, settings={"power": 2, "limits": {"most": 10}}
)


def cases(seconds: float = 0.0) -> list[Number]:
    """Twelve of them, one negative."""
    return [Number(value=value, seconds=seconds) for value in range(-1, 11)]


if __name__ == "__main__":
    run_sweep(Store(sys.argv[1], SQUARES), cases(float(sys.argv[2])), lambda: processes(2))

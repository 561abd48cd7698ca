"""Models as free-format MPS files, which every solver reads.

Variables are called x0, x1, ..., rows r0, r1, ... in the model's order. Numbers are written with as many digits as it
takes to read the same double back.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator

import numpy as np
from scipy.sparse import csc_array

from pscover.errors import Refused
from pscover.files import write_bytes
from pscover.model import Model

OBJECTIVE = "cost"


def write_mps(model: Model, path: str | os.PathLike[str]) -> None:
    """Write a model as free MPS.

    The right-hand side of the objective is minus the model's offset: MPS counts it as standing on the other side of the
    objective's equation (CPLEX, Gurobi, HiGHS and SCIP read it so). Rows without bounds are left out.

    Parameters
    ----------
    model
        What to write.
    path
        Where to.

    Raises
    ------
    Refused
        If MPS cannot express the model: several objectives, numbers that are not finite, crossed bounds.
    PscoverError
        If the file cannot be written.
    """
    write_bytes(path, encode(model).encode())


def encode(model: Model) -> str:
    """A model as the text of a free MPS file; errors as `write_mps`.

    Examples
    --------
    >>> from pscover.instance import Instance
    >>> from pscover.registry import formulation
    >>> instance = Instance.of([[0.75, 0.5]], required=0.75, conflicts=[(0, 1)])
    >>> print(encode(formulation("clique").build(instance)))
    NAME pscover
    ROWS
     N cost
     G r0
     L r1
    COLUMNS
     mark0 'MARKER' 'INTORG'
     x0 cost 1.0
     x0 r0 1.0
     x0 r1 1.0
     x1 cost 1.0
     x1 r0 0.5
     x1 r1 1.0
     mark1 'MARKER' 'INTEND'
    RHS
     rhs r0 1.0
     rhs r1 1.0
    BOUNDS
     UP bound x0 1.0
     UP bound x1 1.0
    ENDATA
    <BLANKLINE>
    """
    _check(model)
    rows = [list(_row(f"r{k}", lo, hi)) for k, (lo, hi) in enumerate(zip(model.lo.tolist(), model.hi.tolist(), strict=True))]
    lines = ["NAME pscover", "ROWS", f" N {OBJECTIVE}"]
    lines += [f" {kind} {name}" for written in rows for name, kind, _, _ in written]
    lines += ["COLUMNS", *_columns(model, [[name for name, _, _, _ in written] for written in rows]), "RHS"]
    if model.offset:
        lines.append(f" rhs {OBJECTIVE} {-float(model.offset)!r}")
    lines += [f" rhs {name} {side!r}" for written in rows for name, _, side, _ in written if side]
    ranges = [f" range {name} {width!r}" for written in rows for name, _, _, width in written if width is not None]
    lines += ["RANGES", *ranges] if ranges else []
    lines += ["BOUNDS", *_bounds(model), "ENDATA", ""]
    return "\n".join(lines)


def _check(model: Model) -> None:
    if model.then:
        raise Refused("an MPS file holds one objective, and the model has several in order of priority")
    if not (np.isfinite(model.c).all() and np.isfinite(model.A.data).all() and math.isfinite(model.offset)):
        raise Refused("an MPS file holds finite numbers, and the model has coefficients that are not")
    crossed = np.flatnonzero(~((model.lo <= model.hi) & (model.lo < np.inf) & (model.hi > -np.inf)))
    if len(crossed):
        k = int(crossed[0])
        raise Refused(f"an MPS file cannot hold crossed bounds, and row {k} has {model.lo[k]} <= a x <= {model.hi[k]}")
    if not (model.ub >= 0).all():
        i = int(np.flatnonzero(~(model.ub >= 0))[0])
        raise Refused(f"an MPS file cannot hold crossed bounds, and variable {i} has 0 <= x <= {model.ub[i]}")


def _row(name: str, lo: float, hi: float) -> Iterator[tuple[str, str, float, float | None]]:
    """The row's entries (name, kind, right-hand side, range): none without bounds, two if no range is exact."""
    if lo == hi:
        yield name, "E", lo, None
    elif math.isinf(lo) or math.isinf(hi):
        if math.isfinite(lo):
            yield name, "G", lo, None
        elif math.isfinite(hi):
            yield name, "L", hi, None
    elif lo + (hi - lo) == hi:
        yield name, "G", lo, hi - lo
    elif hi - (hi - lo) == lo:
        yield name, "L", hi, hi - lo
    else:
        yield name, "G", lo, None
        yield f"{name}u", "L", hi, None


def _columns(model: Model, names: list[list[str]]) -> Iterator[str]:
    """Every variable with at least its objective coefficient; runs of integer ones between markers."""
    A = csc_array(model.A)
    starts, rows, values = A.indptr.tolist(), A.indices.tolist(), A.data.tolist()
    markers, within = 0, False
    for i, (cost, integer) in enumerate(zip(model.c.tolist(), model.integer.tolist(), strict=True)):
        if integer != within:
            yield _marker(markers, integer)
            markers, within = markers + 1, integer
        yield f" x{i} {OBJECTIVE} {cost!r}"
        for k in range(starts[i], starts[i + 1]):
            for name in names[rows[k]]:
                yield f" x{i} {name} {values[k]!r}"
    if within:
        yield _marker(markers, integer=False)


def _marker(count: int, integer: bool) -> str:
    return f" mark{count} 'MARKER' '{'INTORG' if integer else 'INTEND'}'"


def _bounds(model: Model) -> Iterator[str]:
    """An upper bound for every variable: readers disagree on what an integer variable without one is bounded by."""
    for i, upper in enumerate(model.ub.tolist()):
        if upper == 0:
            yield f" FX bound x{i} 0.0"
        elif math.isinf(upper):
            yield f" PL bound x{i}"
        else:
            yield f" UP bound x{i} {upper!r}"

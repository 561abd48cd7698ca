"""Heights above the table in a policy's cycle: CPU milliseconds of a frame of 470 x 282, with the table found and known.

pytest bench/bench_depth.py
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cv2")
from pscover.perception.depth import height_map
from pscover.perception.table_plane import TablePlane

SHAPE = (282, 470)


@pytest.mark.parametrize("table", ["found", "known"])
@pytest.mark.parametrize("holes", ["none", "3 %"])
def bench_height_map(benchmark: Any, row: Any, table: str, holes: str) -> None:
    """A tilted table with a heap, and the noise of a depth camera."""
    rng = np.random.default_rng(0)
    rows, columns = np.indices(SHAPE)
    plane = 1 / (1 + 2e-4 * columns - 1e-4 * rows)
    depth = (plane + rng.normal(0, 0.002, SHAPE)).astype(np.float32)
    depth[60:200, 100:300] -= 0.05
    if holes != "none":
        depth[rng.random(SHAPE) < 0.03] = np.nan
    given = TablePlane(offset=1, slope_x=2e-4, slope_y=-1e-4) if table == "known" else None
    found = height_map(depth, table=given)
    benchmark.pedantic(height_map, (depth,), {"table": given}, rounds=20)
    began = time.process_time()
    for _ in range(20):
        height_map(depth, table=given)
    milliseconds = 1000 * (time.process_time() - began) / 20
    wrong = 1000 * float(np.abs(1 / found.table.inverse_depth(SHAPE) - plane).max())
    row("Heights of a frame", table=table, holes=holes, cpu_milliseconds=milliseconds, plane_wrong_by_mm=wrong)
    assert wrong < 1

"""From photo to scene with the classical segmenter: CPU seconds a stage and peak memory, up to 4K.

pytest bench/bench_perception.py
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cv2")
pytest.importorskip("skimage")
from pscover.images import read_photo
from pscover.perception.perceive import perceive

PHOTOS = Path(__file__).parents[1] / "instances" / "photos"
SIZES = {"as it is": 1.0, "1920 wide": 3.0, "3840 wide (4K)": 6.0}
PEAK = """
import resource, sys
from pscover.perception.perceive import perceive
seen = perceive(sys.argv[1], pixels_per_cm=float(sys.argv[2]))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scale", ["paper's", "finer"])
def bench_perceive(benchmark: Any, row: Any, tmp_path: Path, size: str, scale: str) -> None:
    """A shipped photo, enlarged; "finer" tells the true scale, so that the grid is the small photo's."""
    import cv2

    factor = SIZES[size]
    photo = cv2.resize(read_photo(PHOTOS / "tshirts_0_ex2.jpg"), None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
    path = tmp_path / "photo.jpg"
    cv2.imwrite(str(path), photo[:, :, ::-1])
    pixels_per_cm = 4.7 * (factor if scale == "finer" else 1.0)
    seen = perceive(path, pixels_per_cm=pixels_per_cm)
    benchmark.pedantic(perceive, (path,), {"pixels_per_cm": pixels_per_cm}, rounds=3)
    peak = subprocess.run(
        [sys.executable, "-c", PEAK, str(path), str(pixels_per_cm)], capture_output=True, text=True, check=True
    ).stdout
    row(
        "Perception: from photo to scene, classical",
        size=size,
        scale=scale,
        grid="{1} x {0}".format(*seen.grid.shape),
        garments=seen.scene.garments,
        **{f"{stage.name} CPU s": stage.cpu_seconds for stage in seen.stages},
        cpu_seconds=seen.cpu_seconds,
        peak_mb=float(peak),
    )
    assert seen.scene.garments >= 3

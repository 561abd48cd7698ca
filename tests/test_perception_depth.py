"""From depth to heights above the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings
from pscover.perception.depth import Intrinsics, TablePlane, height_map, read_depth

CAMERA = Intrinsics(fx=400.0, fy=410.0, cx=160.0, cy=118.0)
SHAPE = (240, 320)
NORMAL = np.array([0.15, -0.1, 1.0]) / np.linalg.norm([0.15, -0.1, 1.0])
AWAY = 1.2


def tilted(heap: float = 0.0, seed: int | None = None) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Depths of a tilted table with a flat heap of that height above it, ray by ray."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    rays = np.stack([(x - CAMERA.cx) / CAMERA.fx, (y - CAMERA.cy) / CAMERA.fy, np.ones(SHAPE)], axis=-1)
    on_heap = np.zeros(SHAPE, dtype=np.bool_)
    on_heap[60:200, 80:260] = heap > 0
    z = (AWAY - heap * on_heap) / (rays @ NORMAL)
    if seed is not None:
        z += np.random.default_rng(seed).normal(0, 0.002, SHAPE)
    return z, on_heap


def test_perpendicular_heights_above_a_tilted_table_are_exact() -> None:
    z, on_heap = tilted(heap=0.08)
    found = height_map(z, metres_per_unit=1, camera=CAMERA)
    assert found.metres[on_heap] == pytest.approx(0.08, abs=1e-4)
    assert found.metres[~on_heap] == pytest.approx(0, abs=1e-4)
    assert found.table.distance(CAMERA) == pytest.approx(AWAY, abs=1e-4)
    assert not found.metres.flags.writeable


def test_noise_millimetres_and_holes() -> None:
    z, on_heap = tilted(heap=0.08, seed=1)
    units = np.round(z * 1000).astype(np.uint16)
    units[100:110, 100:110] = 0
    units[:, :5] = 0
    found = height_map(units, camera=CAMERA)
    assert np.median(found.metres[on_heap]) == pytest.approx(0.08, abs=0.002)
    assert found.metres[105, 105] == pytest.approx(0.08, abs=0.01)
    assert found.holes[105, 105]
    assert found.holes.sum() == 100 + 5 * SHAPE[0]
    assert 0 < found.spread < 0.004


def test_without_a_camera_heights_run_along_the_axis() -> None:
    z, on_heap = tilted(heap=0.08)
    table, _ = tilted()
    found = height_map(z, metres_per_unit=1)
    assert found.metres[on_heap] == pytest.approx((table - z)[on_heap], abs=1e-4)


def test_the_table_is_the_lower_plane_even_when_a_heap_is_larger() -> None:
    depth = np.full((60, 80), 1.0)
    depth[:, :45] = 0.9
    found = height_map(depth, metres_per_unit=1)
    assert found.metres[30, 10] == pytest.approx(0.1)
    assert found.metres[30, 70] == pytest.approx(0)


def test_a_known_table_and_a_region() -> None:
    depth = np.full((20, 30), 2.0)
    depth[5:15, 5:25] = 1.9
    inside = np.zeros((20, 30), dtype=np.bool_)
    inside[5:15, 5:25] = True
    assert height_map(depth, metres_per_unit=1, inside=inside).metres[10, 10] == pytest.approx(0)
    plane = TablePlane(offset=0.5, slope_x=0.0, slope_y=0.0)
    assert height_map(depth, metres_per_unit=1, inside=inside, table=plane).metres[10, 10] == pytest.approx(0.1)


def test_depth_files(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    units = np.arange(12, dtype=np.uint16).reshape(3, 4) * 5000
    cv2.imwrite(str(tmp_path / "depth.png"), units)
    np.save(tmp_path / "depth.npy", units.astype(np.float32) / 1000)
    assert (read_depth(tmp_path / "depth.png") == units).all()
    assert read_depth(tmp_path / "depth.npy") == pytest.approx(units / 1000)


@pytest.mark.parametrize(
    "content",
    [b"", b"\x93NUMPY", b"nothing", b"\x93NUMPY\x01\x00\x10\x00{'descr': object}"],
)
def test_damaged_files(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "depth.npy").write_bytes(content)
    with pytest.raises(InvalidImage, match=r"depth\.npy"):
        read_depth(tmp_path / "depth.npy")


def test_hostile_arrays(tmp_path: Path) -> None:
    np.save(tmp_path / "objects.npy", np.array([[{}]], dtype=object), allow_pickle=True)
    np.save(tmp_path / "cube.npy", np.zeros((2, 2, 2)))
    data = (tmp_path / "cube.npy").read_bytes().replace(b"(2, 2, 2)", b"(9999, 99999)").replace(b"    ", b"", 1)
    (tmp_path / "bomb.npy").write_bytes(data)
    for name in ("objects", "cube", "bomb"):
        with pytest.raises(InvalidImage, match=name):
            read_depth(tmp_path / f"{name}.npy")


def test_wrong_depths() -> None:
    for wrong in (np.zeros((3, 3, 3)), np.array([["a"]]), np.array([[1 + 1j]])):
        with pytest.raises(InvalidImage, match="depth: expected numbers of shape"):
            height_map(wrong)
    with pytest.raises(InvalidImage, match="at least 3 measured pixels"):
        height_map(np.zeros((5, 5)))
    with pytest.raises(InvalidImage, match="span none"):
        height_map(np.ones((1, 9)))
    with pytest.raises(InvalidImage, match="region of the depth's shape"):
        height_map(np.ones((5, 5)), inside=np.ones((4, 4), dtype=np.bool_))
    for name in ("metres_per_unit", "tolerance"):
        with pytest.raises(InvalidSettings, match=f"{name}: expected a positive"):
            height_map(np.ones((5, 5)), **{name: 0.0})  # type: ignore[arg-type]
    with pytest.raises(InvalidSettings, match="intrinsics"):
        Intrinsics(fx=0, fy=1, cx=0, cy=0)

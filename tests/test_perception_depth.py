"""From depth to heights above the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings
from pscover.perception.depth import Depth, garment_heights, height_map, read_depth
from pscover.perception.grid import Grid
from pscover.perception.table_plane import Intrinsics, TablePlane

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
    pytest.importorskip("cv2")
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


def test_thin_cloth_hardly_lifts_the_table() -> None:
    rng = np.random.default_rng(2)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    table = 1 / (1 + 1e-4 * x - 1e-4 * y)
    cloth = (np.sin(x / 17) + np.sin(y / 23)) > 0
    found = height_map(table - 0.007 * cloth + rng.normal(0, 0.001, SHAPE))
    assert 0.4 < cloth.mean() < 0.6
    assert np.abs(1 / found.table.inverse_depth(SHAPE) - table).max() < 0.001


def test_whole_numbers_are_millimetres_and_floats_metres_unless_it_is_said() -> None:
    for depth, unit in ((np.full((9, 9), 900), None), (np.full((9, 9), 0.9), None), (np.full((9, 9), 3600), 0.00025)):
        found = height_map(depth, metres_per_unit=unit, table=TablePlane.level(1.0))
        assert found.metres == pytest.approx(0.1, abs=1e-6)
        assert not found.fitted
    assert height_map(np.full((9, 9), 900)).metres_per_unit == 0.001


def test_a_frame_s_depth_is_taken_as_it_is() -> None:
    pytest.importorskip("cv2")
    from pscover.robot import Frame

    depth = np.full((40, 60), 0.8, dtype=np.float32)
    depth[10:20, 10:20], depth[0], depth[14, 14] = 0.75, np.nan, np.inf
    frame = Frame(rgb=np.zeros((40, 60, 3), dtype=np.uint8), depth=depth)
    assert frame.depth is not None
    found = height_map(frame.depth)
    assert found.metres[12:18, 12:18] == pytest.approx(0.05, abs=1e-5)
    assert found.metres[30] == pytest.approx(0, abs=1e-5)
    assert found.holes.sum() == 61
    assert found.hole_share == pytest.approx(61 / 2400)


def test_heights_on_a_coarser_grid_are_those_of_the_pixels() -> None:
    pytest.importorskip("cv2")
    z, _ = tilted(heap=0.08, seed=1)
    z[100:110, 100:110] = 0
    grid = Grid(photo_shape=SHAPE, shape=(60, 80))
    fine, coarse = (
        height_map(z, metres_per_unit=1, camera=CAMERA),
        height_map(z, metres_per_unit=1, camera=CAMERA, grid=grid),
    )
    assert coarse.metres.shape == (60, 80)
    assert coarse.table.distance(CAMERA) == pytest.approx(AWAY, abs=5e-4)
    assert coarse.metres[20:45, 25:60] == pytest.approx(
        fine.metres.reshape(60, 4, 80, 4).mean((1, 3))[20:45, 25:60], abs=0.004
    )
    known = height_map(z, metres_per_unit=1, camera=CAMERA, grid=grid, table=fine.table)
    assert known.metres[20:45, 25:60] == pytest.approx(coarse.metres[20:45, 25:60], abs=5e-4)


def test_holes_take_the_nearest_height() -> None:
    pytest.importorskip("cv2")
    depth = np.full((30, 40), 1.0)
    depth[:, 20:] = 0.9
    depth[10:14, 5:38] = np.nan
    found = height_map(depth, table=TablePlane.level(1.0))
    assert found.metres[12, 8] == 0
    assert found.metres[12, 30] == pytest.approx(0.1)
    assert (found.metres[10:14, 5:38] > 0.05).sum() == 4 * 18


def test_how_high_garments_lie() -> None:
    depth, segments = np.full((20, 30), 1.0), np.full((20, 30), -1, dtype=np.int32)
    segments[2:12, 2:12], segments[2:12, 20:30] = 0, 1
    depth[segments == 0] = 0.98
    depth[2, 2] = 0.1
    heights = height_map(depth, table=TablePlane.level(1.0))
    low, flat = garment_heights(heights, segments, 2)
    assert low.top == pytest.approx(0.02, abs=0.01), "one wrong pixel of a hundred is no top"
    assert low.mean == pytest.approx(0.02 + 0.88 / 100, abs=1e-4)
    assert flat.top == pytest.approx(0, abs=1e-6)


def test_depth_of_another_size_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "small.npy", np.ones((6, 8)))
    grid = Grid.over((12, 16))
    with pytest.raises(InvalidImage, match=r"small\.npy: expected a depth image of the photo's size 16 x 12, got 8 x 6"):
        Depth.of(tmp_path / "small.npy").heights(grid)
    with pytest.raises(InvalidImage, match=r"depth: expected a depth image of the photo's size"):
        Depth.of(np.ones((6, 8))).heights(grid)
    with pytest.raises(InvalidSettings, match="tolerance"):
        Depth(image=np.ones((6, 8)), tolerance=-1)
    for wrong in ((0.0, 0.0, 0.0), (np.nan, 0.0, 0.0), (1e300, 0.0, 0.0), (1.0, 0.0, -1e10)):
        with pytest.raises(InvalidSettings, match=r"table: expected three numbers of at most 1e\+09"):
            TablePlane(offset=wrong[0], slope_x=wrong[1], slope_y=wrong[2])
    with pytest.raises(InvalidSettings, match="table: expected a positive distance"):
        TablePlane.level(-1)
    with pytest.raises(InvalidImage, match="passes behind the camera"):
        height_map(np.ones((9, 9)), table=TablePlane(offset=0.1, slope_x=-1.0))


def test_depth_files(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    units = np.arange(12, dtype=np.uint16).reshape(3, 4) * 5000
    cv2.imwrite(str(tmp_path / "depth.png"), units)
    np.save(tmp_path / "depth.npy", units.astype(np.float32) / 1000)
    assert (read_depth(tmp_path / "depth.png") == units).all()
    assert read_depth(tmp_path / "depth.npy") == pytest.approx(units / 1000)


def test_an_array_that_python_2_has_written_is_read_without_a_word(tmp_path: Path) -> None:
    header = b"{'descr': '<u2', 'fortran_order': False, 'shape': (2L, 3L), }".ljust(117) + b"\n"
    content = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    (tmp_path / "depth.npy").write_bytes(content + np.arange(6, dtype="<u2").tobytes())
    assert read_depth(tmp_path / "depth.npy").tolist() == [[0, 1, 2], [3, 4, 5]]


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
    for wrong in (np.zeros((3, 3, 3)), np.array([["a"]]), np.array([[1 + 1j]]), [[1.0], [2.0, 3.0]]):
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

"""Depth from the command line, and from Python, to tables, documents and pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray

import pscover
from pscover.cli.app import app
from pscover.cli.fail import Exit
from pscover.errors import InvalidImage, InvalidSettings
from pscover.inputs import Look
from pscover.perception.depth import Depth
from pscover.perception.perceive import Settings, perceive
from pscover.perception.table_plane import TablePlane
from pscover.plan_document import document
from pscover.scene import Scene

cv2 = pytest.importorskip("cv2")
pytest.importorskip("skimage")
SHAPE = (90, 160)


def table() -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
    """A grey table 80 cm away with a red and a blue garment, 3 and 5 cm high, and one as grey as the table, 2 cm high."""
    photo = np.full((*SHAPE, 3), 190, dtype=np.int16)
    photo[20:60, 10:50], photo[20:60, 60:100] = (190, 40, 40), (40, 40, 190)
    photo += np.random.default_rng(0).integers(-3, 4, photo.shape, dtype=np.int16)
    depth = np.full(SHAPE, 800, dtype=np.uint16)
    depth[20:60, 10:50], depth[20:60, 60:100], depth[20:60, 110:150] = 770, 750, 780
    depth[30:34, 20:24] = 0
    return photo.astype(np.uint8), depth


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a photo and its depth."""
    monkeypatch.chdir(tmp_path)
    photo, depth = table()
    cv2.imwrite("table.png", photo[:, :, ::-1])
    cv2.imwrite("table.depth.png", depth)
    return tmp_path


def run(*arguments: str | Path) -> Result:
    return CliRunner(env={"COLUMNS": "100"}).invoke(app, [str(a) for a in arguments])


def answer(*arguments: str | Path) -> dict[str, Any]:
    shown = run(*arguments, "--no-figure", "--json", "-q")
    assert shown.exit_code == Exit.VERIFIED, shown.stderr
    found: dict[str, Any] = json.loads(shown.stdout)
    return found


def test_a_plan_says_how_high_everything_lies(here: Path) -> None:
    plan = answer("plan", "table.png", "--depth", "table.depth.png")["plan"]
    assert [garment["top_cm"] for garment in plan["garments"]] == pytest.approx([3, 5], abs=0.1)
    assert [garment["mean_cm"] for garment in plan["garments"]] == pytest.approx([3, 5], abs=0.3)
    assert {round(grasp["height_cm"]) for grasp in plan["grasps"]} == {3, 5}
    used = plan["depth"]
    assert (used["source"], used["metres_per_unit"], used["fitted"]) == ("table.depth.png", 0.001, True)
    assert used["plane"] == pytest.approx([1.25, 0, 0], abs=1e-4)
    assert used["holes"] == pytest.approx(16 / (90 * 160))
    shown = run("plan", "table.png", "--depth", "table.depth.png", "--no-figure", "-q")
    assert "top cm" in shown.stdout
    assert "table found 0.800 m away" in " ".join(shown.stdout.split())
    without = answer("plan", "table.png")["plan"]
    assert without["depth"] is None
    assert without["grasps"][0]["height_cm"] is None


def test_segments_too(here: Path) -> None:
    found = answer("segment", "table.png", "--depth", "table.depth.png", "--depth-scale", "0.002", "--table", "1.6")
    assert [round(row["top_cm"]) for row in found["segments"]] == [6, 10]
    assert found["depth"]["fitted"] is False
    shown = run("segment", "table.png", "--depth", "table.depth.png", "--no-figure", "-q")
    assert "mean cm" in shown.stdout
    assert "top_cm" not in answer("segment", "table.png")["segments"][0]


def test_the_table_and_the_camera_may_be_given(here: Path) -> None:
    camera = "150,150,80,45"
    plane = answer("segment", "table.png", "--depth", "table.depth.png", "--intrinsics", camera, "--table", "1.25,0,0")
    assert plane["depth"]["intrinsics"] == [150, 150, 80, 45]
    assert plane["depth"]["plane"] == [1.25, 0, 0]
    assert [round(row["top_cm"]) for row in plane["segments"]] == [3, 5]


def test_what_is_as_grey_as_the_table_is_found_by_its_height(here: Path) -> None:
    assert len(answer("segment", "table.png", "--depth", "table.depth.png")["segments"]) == 2
    found = answer("segment", "table.png", "--depth", "table.depth.png", "--set-perception", "cloth_height_cm=0.8")
    assert sorted(round(row["top_cm"]) for row in found["segments"]) == [2, 3, 5]


def test_white_on_white_is_found_by_depth_alone() -> None:
    """The figures of bench/depth_table.py, on one of its scenes, made anew."""
    from pscover.generate.garments import garments

    rng = np.random.default_rng(3)
    true = garments(6, 3).labels > 0
    photo = np.clip(220 + rng.normal(0, 2, (*true.shape, 3)), 0, 255).astype(np.uint8)
    depth = 0.9 - 0.01 * true + rng.normal(0, 0.002, true.shape)
    depth[rng.random(true.shape) < 0.03] = np.nan
    colour = perceive(photo, depth=depth).cloth_map.cloth
    height = perceive(photo, depth=depth, settings=Settings(cloth_height_cm=0.5)).cloth_map.cloth
    assert colour.sum() < 0.05 * true.sum()
    assert (height & true).sum() > 0.9 * (height | true).sum()


def test_holes_are_no_cloth() -> None:
    photo, depth = table()
    depth[70:85, 20:140] = 0
    seen = perceive(photo, depth=depth, settings=Settings(cloth_height_cm=0.8))
    assert not seen.cloth_map.cloth[66:].any()
    assert seen.heights is not None
    assert seen.heights.holes[75, 50]


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--depth", "none.png"], "no such file"),
        (["--depth", "small.png"], "photo's size 160 x 90, got 80 x 45"),
        (["--depth", "table.png"], "values are depths, got colour"),
        (["--depth", "."], "no depth image of it in ."),
        (["--depth", "table.depth.png", "--depth-scale", "0"], "metres_per_unit: expected a positive"),
        (["--depth", "table.depth.png", "--depth-scale", "1e-9"], "check the scale"),
        (["--depth", "table.depth.png", "--table", "far"], "the distance of the table in metres"),
        (["--depth", "table.depth.png", "--table", "1,2"], "the distance of the table in metres"),
        (["--depth", "table.depth.png", "--table", "-1"], "expected a positive distance"),
        (["--depth", "table.depth.png", "--intrinsics", "1,2,3"], "fx,fy,cx,cy"),
        (["--depth", "table.depth.png", "--intrinsics", "0,1,2,3"], "positive focal lengths"),
        (["--table", "1"], "name one with --depth"),
        (["--set-perception", "cloth_height_cm=1"], "expected a depth image with it"),
        (["--depth", "table.depth.png", "--set-perception", "cloth_height_cm=-1"], "cloth_height_cm: expected centimetres"),
        (["--depth", "table.depth.png", "-o", "table.depth.png"], "would replace an input"),
    ],
)
def test_bad_input_is_one_line(here: Path, options: list[str], word: str) -> None:
    cv2.imwrite("small.png", np.full((45, 80), 800, dtype=np.uint16))
    if options[1] == ".":
        Path("table.depth.png").rename("other.depth.png")
    shown = run("segment", "table.png", "--no-figure", *options)
    assert shown.exit_code == Exit.BAD_INPUT
    assert word in " ".join(shown.stderr.split())
    assert "Traceback" not in shown.output
    assert shown.stdout == ""


def test_a_doubtful_scale_gets_a_note(here: Path) -> None:
    shown = run("segment", "table.png", "--depth", "table.depth.png", "--depth-scale", "0.1", "--no-figure")
    assert "the table is 80 m away; if that is not so, give --depth-scale" in shown.stderr
    shown = run("segment", "table.png", "--depth", "table.depth.png", "--table", "2", "--no-figure")
    assert "no measured pixel lies near the table" in shown.stderr


def test_folders(here: Path) -> None:
    photo, depth = table()
    photos, depths = here / "photos", here / "depths"
    photos.mkdir()
    depths.mkdir()
    for stem in ("a", "b", "c"):
        cv2.imwrite(str(photos / f"{stem}.png"), photo[:, :, ::-1])
    cv2.imwrite(str(depths / "a.png"), depth)
    np.save(depths / "b.npy", depth / 1000)
    shown = run("segment", "photos", "-o", "out", "--depth", "depths", "--no-figure", "--json", "-q")
    assert shown.exit_code == Exit.BAD_INPUT
    assert "c.png: no depth image of it in" in shown.stderr
    rows = json.loads(shown.stdout)["photos"]
    assert [[round(segment["top_cm"]) for segment in row["segments"]] for row in rows] == [[3, 5], [3, 5]]
    for stem in ("a", "b", "c"):
        cv2.imwrite(str(photos / f"{stem}.depth.png"), depth)
    shown = run("plan", "photos", "-o", "out", "--depth", "photos", "--no-figure", "-q")
    assert shown.exit_code == Exit.VERIFIED, "depth beside photos is taken for no photo"
    assert json.loads((here / "out" / "c.plan.json").read_text())["depth"]["source"].endswith("c.depth.png")
    shown = run("plan", "photos", "-o", "out", "--depth", "table.depth.png")
    assert shown.exit_code == Exit.BAD_INPUT
    assert "name a folder" in shown.stderr


def test_labels_and_annotations_have_heights_too(here: Path) -> None:
    labels = np.zeros(SHAPE, dtype=np.uint8)
    labels[20:60, 10:50] = 7
    cv2.imwrite("table.labels.png", labels)
    assert answer("segment", "table.labels.png", "--depth", "table.depth.png")["segments"][0]["top_cm"] == pytest.approx(3)
    np.save("masks.npy", labels)
    assert answer("segment", "masks.npy", "--depth", "table.depth.png")["segments"][0]["top_cm"] == pytest.approx(3)


def test_in_python(here: Path) -> None:
    photo, depth = table()
    for given in (depth, "table.depth.png", Path("table.depth.png"), Depth(image=depth, table=TablePlane.level(0.8))):
        found = pscover.plan(photo, depth=given)
        assert [round(100 * high.top) for high in found.seen.garment_heights or ()] == [3, 5]
    metres = Depth(image=depth / 1000)
    assert document(pscover.plan("table.png", depth=metres)).depth is not None
    labels = np.where(depth == 770, 1, 0)
    assert pscover.plan(labels, depth=depth).seen.heights is not None
    assert pscover.plan(Scene.of(labels), depth=depth).seen.heights is not None
    assert perceive(photo, depth=depth).stages[2].name == "depth"
    with pytest.raises(InvalidSettings, match="looked at already"):
        pscover.plan(Look().photo(photo), depth=depth)
    with pytest.raises(InvalidImage, match="photo's size"):
        pscover.plan(photo, depth=depth[::2])


def test_a_finer_photo_has_the_same_heights(here: Path) -> None:
    photo, depth = table()
    large = cv2.resize(photo, None, fx=4, fy=4, interpolation=cv2.INTER_NEAREST)
    fine = cv2.resize(depth, None, fx=4, fy=4, interpolation=cv2.INTER_NEAREST)
    seen = Look(pixels_per_cm=4 * 4.7).photo(large, depth=fine)
    assert seen.heights is not None
    assert seen.heights.metres.shape == seen.scene.shape == SHAPE
    assert seen.heights.metres[40, 80] == pytest.approx(0.05, abs=1e-3)
    assert seen.table_distance == pytest.approx(0.8, abs=1e-4)

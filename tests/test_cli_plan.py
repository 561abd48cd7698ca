"""`pscover plan`."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from pscover.cli.app import app
from pscover.cli.fail import Exit
from pscover.encoding import encode_labels
from pscover.io import load_instance

cv2 = pytest.importorskip("cv2")
LABELS = Path(__file__).resolve().parent.parent.parent / "shared" / "labels"


def run(*arguments: str | Path) -> Result:
    return CliRunner(env={"COLUMNS": "80"}).invoke(app, [str(a) for a in arguments])


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, empty but for two garments side by side."""
    monkeypatch.chdir(tmp_path)
    labels = np.zeros((80, 160), dtype=int)
    labels[20:60, 10:60], labels[20:60, 60:110] = 1, 2
    Path("table.png").write_bytes(encode_labels(labels))
    return tmp_path


def test_one_command_writes_a_picture_and_says_where(here: Path) -> None:
    pytest.importorskip("matplotlib")
    shown = run("plan", "table.png")
    assert shown.exit_code == Exit.VERIFIED
    assert re.match(r"\d grasps? removes? 2 garments, each with probability >= 0.7; proven optimal", shown.stdout)
    assert "verified  yes" in shown.stdout
    assert "picture   table.plan.png" in shown.stdout
    assert "garment 1" in shown.stdout
    assert max(map(len, shown.stdout.splitlines())) <= 80
    assert "\x1b" not in shown.output
    picture = cv2.imread(str(here / "table.plan.png"))
    assert picture.shape[1] == 1200


def test_the_same_as_json(here: Path) -> None:
    shown = run("plan", "table.png", "--no-figure", "--json", "-o", "plan.json", "--save-instance", "i.json")
    assert shown.exit_code == Exit.VERIFIED
    content: dict[str, Any] = json.loads(shown.stdout)
    plan = content["plan"]
    assert plan["schema"] == "pscover.plan/1"
    assert plan["status"] == "optimal"
    assert len(plan["grasps"]) == plan["bound"]
    assert content["verification"]["passed"] is True
    assert content["figure"] is None
    assert json.loads((here / "plan.json").read_text())["grasps"] == plan["grasps"]
    assert load_instance(here / "i.json").digest == plan["instance"]
    assert sorted(p.name for p in here.iterdir()) == ["i.json", "plan.json", "table.png"]


def test_garments_out_of_reach_get_the_closest_plan_and_code_1(here: Path) -> None:
    shown = run("plan", "table.png", "--required", "0.95", "--no-figure")
    assert shown.exit_code == Exit.NO_PLAN
    assert "less surely removed than required" in shown.stdout
    assert "(short)" in shown.stdout


def test_nothing_on_the_surface(here: Path) -> None:
    (here / "empty.png").write_bytes(encode_labels(np.zeros((50, 60), dtype=int)))
    shown = run("plan", "empty.png", "--no-figure")
    assert shown.exit_code == Exit.VERIFIED
    assert "no grasp is needed" in shown.stdout


def test_the_photo_beside_the_labels_is_found(here: Path) -> None:
    pytest.importorskip("matplotlib")
    (here / "table.png").rename(here / "table.labels.png")
    cv2.imwrite(str(here / "table.jpg"), np.full((80, 160, 3), 90, dtype=np.uint8))
    shown = run("plan", "table.labels.png")
    assert shown.exit_code == Exit.VERIFIED
    assert (here / "table.plan.png").exists()
    cv2.imwrite(str(here / "table.jpg"), np.full((8, 16, 3), 90, dtype=np.uint8))
    shown = run("plan", "table.labels.png")
    assert shown.exit_code == Exit.BAD_INPUT
    assert "size" in shown.stderr


def test_the_gripper_follows_the_scale(here: Path) -> None:
    small = np.zeros((80, 160), dtype=int)
    small[20:60, 10:60] = 1
    (here / "small.png").write_bytes(encode_labels(small))
    (here / "large.png").write_bytes(encode_labels(small.repeat(2, axis=0).repeat(2, axis=1)))
    highest = []
    for name, scale in (("small", "4.7"), ("large", "9.4")):
        options = ["--pixels-per-cm", scale, "--points", "60", "--no-figure", "--save-instance", f"{name}.json"]
        assert run("plan", f"{name}.png", *options).exit_code == Exit.VERIFIED
        highest.append(load_instance(f"{name}.json").probability.data.max())
    assert highest[0] == pytest.approx(highest[1], abs=0.01)


@pytest.mark.parametrize("rule", ["partition", "ellipse", "distance"])
def test_conflict_rules(here: Path, rule: str) -> None:
    shown = run("plan", "table.png", "--conflicts", rule, "--no-figure", "--points", "3", "--orientations", "4")
    assert shown.exit_code == Exit.VERIFIED


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["none.png"], "no such file"),
        (["."], "directory"),
        (["table.png", "--photo", "none.jpg"], "no such file"),
        (["table.png", "--points", "0"], "points"),
        (["table.png", "--pixels-per-cm", "-1"], ""),
        (["table.png", "--pixels-per-cm", "0"], ""),
        (["table.png", "--required", "1"], "required"),
        (["table.png", "--time", "0"], "time"),
        (["table.png", "--conflicts", "elipse"], "ellipse"),
        (["table.png", "--figure", "x.bmp"], ".png"),
        (["table.png", "--figure", "table.png"], "replace an input"),
        (["table.png", "-o", "x.json", "--save-instance", "x.json"], "two outputs"),
    ],
)
def test_bad_input_is_one_line(here: Path, options: list[str], word: str) -> None:
    shown = run("plan", *options)
    assert shown.exit_code == Exit.BAD_INPUT
    assert word in shown.stderr.splitlines()[0]
    assert "bug" not in shown.stderr
    assert [p.name for p in here.iterdir()] == ["table.png"]


def test_a_colour_image_is_a_photo_unless_it_is_said_to_hold_labels(here: Path) -> None:
    cv2.imwrite("colour.png", np.full((40, 40, 3), 90, dtype=np.uint8))
    shown = run("plan", "colour.png", "--no-figure")
    assert shown.exit_code == Exit.VERIFIED
    assert "nothing lies on the surface" in shown.stdout
    shown = run("plan", "colour.png", "--no-figure", "--as", "labels")
    assert shown.exit_code == Exit.BAD_INPUT
    assert "grey PNG" in shown.stderr


def test_without_matplotlib_the_plan_is_still_made(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib.util import find_spec

    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "matplotlib" else find_spec(name))
    shown = run("plan", "table.png")
    assert shown.exit_code == Exit.VERIFIED
    assert 'pip install "pscover[figures]"' in shown.stderr
    shown = run("plan", "table.png", "--figure", "x.png")
    assert shown.exit_code == Exit.MISSING


def test_without_pillow_the_pip_line_is_shown(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL.PngImagePlugin", None)
    shown = run("plan", "table.png", "--no-figure")
    assert shown.exit_code == Exit.MISSING
    assert 'pip install "pscover[perception]"' in shown.stderr


@pytest.mark.skipif(not LABELS.is_dir(), reason="needs the real label images in ../shared/labels")
def test_a_real_scene(here: Path) -> None:
    shown = run("plan", LABELS / "tshirts_0_ex1.png", "--no-figure")
    assert shown.exit_code == Exit.VERIFIED
    assert "3 garments" in shown.stdout

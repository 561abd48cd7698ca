"""`pscover segment`: labels, masks and pictures of photos."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray

from pscover.cli.app import app
from pscover.cli.fail import Exit
from pscover.images import read_labels
from pscover.inputs import Look
from pscover.perception.annotations import read_annotations
from pscover.scene import Scene
from pscover.seen import Seen

cv2 = pytest.importorskip("cv2")
pytest.importorskip("skimage")
PHOTOS = Path(__file__).parents[1] / "instances" / "photos"
real = pytest.mark.skipif(not PHOTOS.is_dir(), reason="the photos of the repository are not here")


def run(*arguments: str | Path) -> Result:
    return CliRunner(env={"COLUMNS": "80"}).invoke(app, [str(a) for a in arguments])


def table(scale: int = 1) -> NDArray[np.uint8]:
    photo = np.full((90, 160, 3), 190, dtype=np.uint8)
    photo[20:60, 10:60], photo[20:70, 80:130] = (190, 40, 40), (40, 40, 190)
    return photo.repeat(scale, axis=0).repeat(scale, axis=1)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("table.png", table()[:, :, ::-1])
    return tmp_path


def test_labels_masks_picture_and_table(here: Path) -> None:
    pytest.importorskip("matplotlib")
    shown = run("segment", "table.png", "-o", "labels.png", "--coco", "masks.json")
    assert shown.exit_code == Exit.VERIFIED
    assert shown.stdout.startswith("2 segments\n")
    assert re.search(r"clean-up \d+\.\d\d", " ".join(shown.stdout.split()))
    assert sorted(path.name for path in here.iterdir()) == ["labels.png", "masks.json", "table.png", "table.segments.png"]
    labels = read_labels("labels.png")
    seen = Look().read("table.png")
    assert (labels == seen.labels).all()
    masks = read_annotations("masks.json", shape=labels.shape[:2])
    assert masks.image == "table.png"
    assert [mask.name for mask in masks.masks] == list(seen.scene.names)
    for value, mask in enumerate(masks.masks, start=1):
        assert (mask.pixels((90, 160)) == (labels == value)).all()


def test_areas_are_in_pixels_of_the_photo_and_in_square_centimetres(here: Path) -> None:
    cv2.imwrite("fine.png", table(6)[:, :, ::-1])
    shown = run("segment", "fine.png", "--px-per-cm", "28.2", "-o", "labels.png", "--no-figure", "--json")
    assert shown.exit_code == Exit.VERIFIED
    document = json.loads(shown.stdout)
    assert (document["width"], document["height"]) == (960, 540)
    labels = read_labels("labels.png")
    assert labels.shape == (540, 960)
    for row, (height, width) in zip(document["segments"], ((50, 50), (40, 50)), strict=True):
        assert row["pixels"] == (labels == row["label"]).sum()
        assert row["cm2"] == pytest.approx(row["pixels"] / 28.2**2, rel=1e-9)
        assert row["cm2"] == pytest.approx(height * width / 4.7**2, rel=0.25)
        assert 0 <= row["score"] <= 1


def test_nothing_there(here: Path) -> None:
    cv2.imwrite("empty.png", np.full((60, 80, 3), 190, dtype=np.uint8))
    shown = run("segment", "empty.png", "-o", "labels.png", "--coco", "masks.json", "--no-figure")
    assert shown.exit_code == Exit.VERIFIED
    assert shown.stdout.startswith("0 segments\n")
    assert not read_labels("labels.png").any()
    assert read_annotations("masks.json").masks == ()


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["none.png"], "no such file"),
        (["table.png", "-o", "labels.jpg"], ".png"),
        (["table.png", "-o", "table.png"], "replace an input"),
        (["table.png", "--coco", "masks.txt"], ".json"),
        (["table.png", "-o", "a.png", "--figure", "a.png"], "two outputs"),
        (["table.png", "--figure", "a.png", "--no-figure"], "exclude each other"),
        ([".", "-o", "out", "--coco", "c.json"], "for one photo"),
        (["."], "directory"),
    ],
)
def test_bad_input_is_one_line(here: Path, options: list[str], word: str) -> None:
    shown = run("segment", *options)
    assert shown.exit_code == Exit.BAD_INPUT
    assert word in shown.stderr.splitlines()[0]
    assert [path.name for path in here.iterdir()] == ["table.png"]


def test_a_folder(here: Path) -> None:
    (here / "cut.jpg").write_bytes(b"\xff\xd8\xff\xe0")
    shown = run("segment", ".", "-o", "out", "--no-figure")
    assert shown.exit_code == Exit.BAD_INPUT
    assert "cut.jpg" in shown.stderr
    assert "failed" in shown.stdout
    assert [path.name for path in (here / "out").iterdir()] == ["table.labels.png"]
    (here / "cut.jpg").unlink()
    shown = run("segment", ".", "-o", "out", "--no-figure", "--json", "-q")
    assert shown.exit_code == Exit.VERIFIED
    assert [len(row["segments"]) for row in json.loads(shown.stdout)["photos"]] == [2]


def test_the_picture_numbers_every_segment() -> None:
    pytest.importorskip("matplotlib")
    from pscover.figures.scene import middles, render_scene, scene_figure

    labels = np.zeros((60, 90), dtype=int)
    labels[5:50, 5:30], labels[10:40, 40:80] = 3, 7
    scene = Scene.of(labels, photo=np.full((60, 90, 3), 99, dtype=np.uint8))
    seen = Seen.whole(scene, "a $hostile$ name_{")
    photo, segments = scene_figure(seen).axes
    assert [text.get_text() for text in segments.texts] == ["3", "7"]
    assert list(photo.texts) == []
    for (x, y), value in zip(middles(scene).round().astype(int), (3, 7), strict=True):
        assert labels[y, x] == value
    assert render_scene(seen).startswith(b"\x89PNG")
    assert b"<svg" in render_scene(seen, "svg")


@real
@pytest.mark.parametrize("name", ["tshirts_0_ex2", "tshirts_244_color", "tshirts_363_color"])
def test_the_photos_of_the_repository(here: Path, name: str) -> None:
    shown = run("segment", PHOTOS / f"{name}.jpg", "-o", "labels.png", "--no-figure", "-q")
    assert shown.exit_code == Exit.VERIFIED
    assert shown.stderr == ""
    assert 3 <= read_labels("labels.png").max() <= 30

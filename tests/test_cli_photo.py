"""`pscover plan` for photos, annotations and folders, and the listings of segmenters and weights."""

from __future__ import annotations

import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray

import pscover
from pscover import registry
from pscover.cli.app import app
from pscover.cli.fail import Exit
from pscover.cli.look import region
from pscover.inputs import Kind, Look, kind_of
from pscover.io import load_instance
from pscover.perception.annotations import write_annotations
from pscover.perception.connectors.contract import Annotations
from pscover.perception.mask import Mask
from pscover.perception.perceive import perceive
from pscover.scene import Scene

cv2 = pytest.importorskip("cv2")
Image = pytest.importorskip("PIL.Image")
pytest.importorskip("skimage")
PHOTOS = Path(__file__).parents[1] / "instances" / "photos"
RECORDS = Path(__file__).parents[2] / "shared" / "sam_records"
SHIRTS = PHOTOS / "tshirts_363_color.jpg"
CORNERS = ("78,56", "466,56", "476,364", "62,364")
real = pytest.mark.skipif(not SHIRTS.is_file(), reason="the photos of the repository are not here")
with_records = pytest.mark.skipif(not RECORDS.is_dir(), reason="needs the real records in ../shared/sam_records")


def run(*arguments: str | Path) -> Result:
    return CliRunner(env={"COLUMNS": "80"}).invoke(app, [str(a) for a in arguments])


def table(scale: int = 1) -> NDArray[np.uint8]:
    """A grey table with a red and a blue garment, off its border; noise as a camera has it."""
    photo = np.full((90, 160, 3), 190, dtype=np.int16)
    photo[20:60, 10:60], photo[20:60, 80:130] = (190, 40, 40), (40, 40, 190)
    photo = photo.repeat(scale, axis=0).repeat(scale, axis=1)
    photo += np.random.default_rng(0).integers(-3, 4, photo.shape, dtype=np.int16)
    return photo.astype(np.uint8)


def write(path: str | Path, photo: NDArray[np.uint8]) -> None:
    assert cv2.imwrite(str(path), photo[:, :, ::-1])


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, empty but for a photo of two garments."""
    monkeypatch.chdir(tmp_path)
    write("table.jpg", table())
    return tmp_path


def plan_of(*arguments: str | Path, code: Exit = Exit.VERIFIED) -> dict[str, Any]:
    shown = run("plan", *arguments, "--no-figure", "--json", "-q")
    assert shown.exit_code == code, shown.stderr
    document: dict[str, Any] = json.loads(shown.stdout)["plan"]
    return document


def test_from_photo_to_plan_in_one_command(here: Path) -> None:
    pytest.importorskip("matplotlib")
    shown = run("plan", "table.jpg", "-o", "plan.json", "--save-instance", "i.json", "--html", "report.html")
    assert shown.exit_code == Exit.VERIFIED
    assert "2 garments, each with probability >= 0.7" in shown.stdout
    assert "photo of 160 x 90 pixels, segmented by classical, background auto" in " ".join(shown.stdout.split())
    for stage in ("cloth", "clean-up", "candidates", "solve", "picture"):
        assert re.search(rf"{stage} \d+\.\d\d", " ".join(shown.stdout.split()))
    assert max(map(len, shown.stdout.splitlines())) <= 80
    made = {"i.json", "plan.json", "report.html", "table.jpg", "table.plan.png"}
    assert {path.name for path in here.iterdir()} == made
    plan = json.loads(Path("plan.json").read_text())
    assert (plan["width"], plan["height"], plan["basket"]) == (160, 90, [159.0, 44.5])
    assert load_instance("i.json").digest == plan["instance"]
    assert list(plan["seconds"])[-2:] == ["candidates", "solve"]


def test_grasps_are_in_pixels_of_the_photo_however_coarse_the_grid(here: Path) -> None:
    write("fine.png", table(6))
    plan = plan_of("fine.png", "--px-per-cm", "28.2", "--basket", "900,200", "--save-instance", "i.json")
    assert "on a grid of 160 x 90" in plan["origin"]
    assert (plan["width"], plan["height"], plan["pixels_per_cm"]) == (960, 540, pytest.approx(28.2))
    assert plan["basket"] == pytest.approx([900, 200])
    assert len(plan["grasps"]) == 2
    fine = table(6)
    for grasp in plan["grasps"]:
        colour = fine[round(grasp["y"]), round(grasp["x"])]
        assert int(colour.max()) - int(colour.min()) > 100, "the point lies on a garment"
        assert grasp["basket_cm"] == pytest.approx(np.hypot(grasp["x"] - 900, grasp["y"] - 200) / 28.2)
    poses = load_instance("i.json").meta.poses
    assert poses is not None
    assert {(grasp["x"], grasp["y"]) for grasp in plan["grasps"]} <= {(x, y) for x, y, _ in poses.tolist()}
    coarse = plan_of("table.jpg", "--basket", "149.5,32.8")
    assert len(coarse["grasps"]) == len(plan["grasps"])


@pytest.mark.parametrize("background", ["auto", "#bebebe", "190,190,190", "empty.png"])
def test_the_surface_may_be_said_in_several_ways(here: Path, background: str) -> None:
    write("empty.png", np.full((90, 160, 3), 190, dtype=np.uint8))
    assert len(plan_of("table.jpg", "--background", background)["garments"]) == 2


def test_the_region_may_be_said_in_several_ways(here: Path) -> None:
    Path("roi.txt").write_text("0,0 70,0\n70,89 0,89\n")
    Path("roi.json").write_text("[[0, 0], [70, 0], [70, 89], [0, 89]]")
    corners = ["0,0", "70,0", "70,89", "0,89"]
    for roi in (corners, [" ".join(corners)], ["roi.txt"], ["roi.json"]):
        assert len(plan_of("table.jpg", "--roi", *roi)["garments"]) == 1, roi
    assert region("1,2 3,4 5,-6e1") == ((1.0, 2.0), (3.0, 4.0), (5.0, -60.0))


def test_parameters_of_segmenter_and_perception_reach_them(here: Path) -> None:
    assert len(plan_of("table.jpg", "--set-segmenter", "limit=100000")["garments"]) == 2, "they do not touch"
    plan = plan_of("table.jpg", "--set-perception", "min_segment_area=5000")
    assert plan["garments"] == []
    assert "(limit=3)" in plan_of("table.jpg", "--set-segmenter", "limit=3")["origin"]


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["table.jpg", "--segmenter", "clasical"], "did you mean 'classical'?"),
        (["table.jpg", "--set-segmenter", "limt=3"], "did you mean 'limit'?"),
        (["table.jpg", "--set-perception", "thresold=3"], "did you mean 'threshold'?"),
        (["table.jpg", "--set-perception", "kernel=wide"], "kernel"),
        (["table.jpg", "--set-perception", "kernel"], "NAME=VALUE"),
        (["table.jpg", "--roi", "1,2"], "3 to"),
        (["table.jpg", "--roi", "none.txt"], "none.txt"),
        (["table.jpg", "--roi", "900,900", "950,900", "950,950"], "roi"),
        (["table.jpg", "--background", "#12"], "background"),
        (["table.jpg", "--px-per-cm", "0"], "positive"),
        (["table.jpg", "--photo", "table.jpg"], "the input is a photo itself"),
        (["table.jpg", "--as", "labels"], "JPEG"),
        (["table.jpg", "--html", "table.jpg"], ".html"),
        (["table.jpg", "--html", "none/report.html"], "no folder"),
        (["table.jpg", "--html", "x.html", "--figure", "x.htm"], ".png"),
        (["noise.bin"], "expected a photo"),
        (["empty.jpg"], "empty file"),
        (["labels.png", "--roi", *CORNERS], "for photos"),
    ],
)
def test_bad_input_is_one_line(here: Path, options: list[str], word: str) -> None:
    Path("noise.bin").write_bytes(b"II*\x00 some other image")
    Path("empty.jpg").touch()
    cv2.imwrite("labels.png", np.ones((20, 20), dtype=np.uint8))
    before = sorted(here.iterdir())
    shown = run("plan", *options, "--no-figure" if "--figure" not in options else "-q")
    assert shown.exit_code == Exit.BAD_INPUT
    assert word in shown.stderr.splitlines()[0]
    assert "bug" not in shown.stderr
    assert sorted(here.iterdir()) == before


def test_without_its_packages_a_segmenter_is_answered_with_the_pip_line(monkeypatch: pytest.MonkeyPatch, here: Path) -> None:
    monkeypatch.setattr("pscover.registry.missing", lambda found: ("skimage",) if found.name == "classical" else ())
    shown = run("plan", "table.jpg", "--no-figure")
    assert shown.exit_code == Exit.MISSING
    assert 'pip install "pscover[perception]"' in shown.stderr


def test_what_a_file_is_its_content_says(here: Path) -> None:
    grey = cv2.cvtColor(table(), cv2.COLOR_RGB2GRAY)
    noisy = grey + np.random.default_rng(1).integers(0, 9, grey.shape).astype(np.uint8)
    cv2.imwrite("grey.png", noisy)
    smooth = np.add.outer(np.arange(90) ** 2 / 300, np.arange(160) / 4).astype(np.uint8)
    cv2.imwrite("smooth.png", smooth + (noisy & 1) * (np.arange(160) % 8 == 0))
    cv2.imwrite("fine.png", noisy.astype(np.uint16) * 257)
    Image.fromarray(table()).quantize(64).save("palette.png")
    cv2.imwrite("labels.png", np.ones((20, 30), dtype=np.uint8))
    cv2.imwrite("wide.png", np.full((20, 30), 700, dtype=np.uint16))
    cv2.imwrite("cells.png", np.arange(300, dtype=np.uint16).reshape(15, 20).repeat(8, axis=0).repeat(8, axis=1))
    Image.fromarray(np.eye(9, dtype=np.uint8), mode="P").save("flat.png")
    write("colour.png", table())
    shutil.copy("table.jpg", "disguised.json")
    np.save("labels.npy", np.ones((3, 4), dtype=int))
    Path("amg").mkdir()
    Path("amg", "metadata.csv").touch()
    expected = {
        **dict.fromkeys(("table.jpg", "grey.png", "colour.png", "disguised.json"), Kind.PHOTO),
        **dict.fromkeys(("smooth.png", "fine.png", "palette.png"), Kind.PHOTO),
        **dict.fromkeys(("labels.png", "wide.png", "cells.png", "flat.png"), Kind.LABELS),
        **dict.fromkeys(("labels.npy", "amg"), Kind.ANNOTATIONS),
        ".": Kind.FOLDER,
    }
    assert {name: kind_of(name) for name in expected} == expected


def masks() -> Annotations:
    """Two garments as somebody drew them, and a third that the second hides."""
    first, second, third = (np.zeros((90, 160)) for _ in range(3))
    first[20:60, 10:60], second[20:60, 80:130], third[30:50, 90:110] = 1, 1, 1
    drawn = (Mask.of(first, name="shirt", score=0.5), Mask.of(second), Mask.of(third, name="shirt"))
    return Annotations(masks=drawn, shape=(90, 160), image="table.jpg")


@pytest.mark.parametrize("name", ["drawn.json", "drawn.png", "drawn.npz"])
def test_masks_drawn_elsewhere_are_taken_as_they_are(here: Path, name: str) -> None:
    if name.endswith(".npz"):
        np.savez(name, masks=np.stack([mask.pixels((90, 160)) for mask in masks().masks]))
    else:
        write_annotations(masks(), name)
    plan = plan_of(name, "--required", "0.5")
    assert len(plan["garments"]) == 3
    if name.endswith(".json"):
        assert [garment["name"] for garment in plan["garments"]] == ["shirt 1", "garment", "shirt 3"]
    # Held against the photo's cloth map, which they fit, because a background is named.
    if not name.endswith(".png"):
        assert len(plan_of(name, "--photo", "table.jpg", "--background", "190,190,190")["garments"]) == 2


def test_a_file_that_describes_several_images_is_read_for_the_photo(here: Path) -> None:
    write_annotations(masks(), "many.json")
    many = json.loads(Path("many.json").read_text())
    many["images"].append({"id": 2, "file_name": "other.jpg", "width": 10, "height": 10})
    Path("many.json").write_text(json.dumps(many))
    assert len(plan_of("many.json", "--photo", "table.jpg", "--required", "0.5")["garments"]) == 3
    shown = run("plan", "many.json", "--no-figure")
    assert shown.exit_code == Exit.BAD_INPUT
    assert "say which" in shown.stderr


@with_records
@real
def test_records_of_segment_anything_need_neither_torch_nor_onnxruntime(monkeypatch: pytest.MonkeyPatch, here: Path) -> None:
    for name in ("torch", "onnxruntime", "segment_anything"):
        monkeypatch.setitem(sys.modules, name, None)
    records = RECORDS / "363_color_16.json"
    plan = plan_of(records, "--photo", SHIRTS, "--roi", *CORNERS)
    assert "held against its cloth map" in plan["origin"]
    assert 4 <= len(plan["garments"]) <= 8
    alone = plan_of(records)
    assert "taken for the surface by place and size" in alone["origin"]
    there = Look().read(records).scene
    assert there.areas().max() < 0.4 * there.labels.size, "the table is no garment"


@real
def test_the_first_command_of_a_newcomer(here: Path) -> None:
    plan = plan_of(SHIRTS, "--roi", *CORNERS, "--html", "report.html")
    assert 3 <= len(plan["garments"]) <= 6
    assert len(plan["grasps"]) <= len(plan["garments"])
    assert Path("report.html").stat().st_size > 50_000


@pytest.fixture
def folder(here: Path) -> Path:
    """Three photos, of which one is cut off; what was made of one of them lies there too."""
    photos = here / "photos"
    photos.mkdir()
    for name in ("a.jpg", "b.PNG", "c.jpg"):
        write(photos / name, table())
    (photos / "c.jpg").write_bytes((photos / "c.jpg").read_bytes()[:900])
    cv2.imwrite(str(photos / "a.labels.png"), np.ones((90, 160), dtype=np.uint8))
    (photos / "notes.txt").write_text("no photo")
    return photos


def test_one_bad_photo_of_a_folder_does_not_stop_the_rest(folder: Path, here: Path) -> None:
    shown = run("plan", folder, "-o", "plans", "--no-figure")
    assert shown.exit_code == Exit.BAD_INPUT
    assert shown.stderr.count("error") == 1
    assert "c.jpg: the JPEG is cut off" in shown.stderr
    assert "failed" in shown.stdout
    assert sorted(path.name for path in (here / "plans").iterdir()) == ["a.html", "a.plan.json", "b.html", "b.plan.json"]
    (folder / "c.jpg").unlink()
    shown = run("plan", folder, "-o", "plans", "--no-figure", "--json", "-q")
    assert shown.exit_code == Exit.VERIFIED
    document = json.loads(shown.stdout)
    assert [row["garments"] for row in document["photos"]] == [2, 2]
    assert document["failed"] == []
    assert run("plan", folder, "-o", "plans", "--no-figure", "--required", "0.95", "-q").exit_code == Exit.NO_PLAN


def test_ctrl_c_in_a_folder_is_told_with_what_is_done(folder: Path, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def read(self: Look, path: Path, **others: Any) -> Any:
        if path.name == "b.PNG":
            raise KeyboardInterrupt
        return look(self, path, **others)

    look = Look.read
    monkeypatch.setattr(Look, "read", read)
    shown = run("plan", folder, "-o", "plans", "--no-figure")
    assert shown.exit_code == Exit.INTERRUPTED
    assert "interrupted after 1 photo; the rest was not looked at" in shown.stderr
    assert "a.jpg" in shown.stdout


@pytest.mark.parametrize(
    ("garments", "word"),
    [([], "nothing has another colour than the surface"), ([(45, 45, 570, 370)], "of the photo is taken for garments")],
)
def test_next_to_nothing_or_everything_gets_a_note(here: Path, garments: list[tuple[int, ...]], word: str) -> None:
    photo = np.full((460, 660, 3), 190, dtype=np.uint8)
    for x, y, width, height in garments:
        photo[y : y + height, x : x + width] = 40, 60, 160
    write("doubtful.png", photo)
    assert word in run("segment", "doubtful.png", "--no-figure").stderr
    assert "taken for garments" not in run("segment", "table.jpg", "--no-figure").stderr


def test_a_bug_in_one_photo_is_told_and_the_rest_is_planned(
    folder: Path, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(self: Look, path: Path, **others: object) -> None:
        raise ZeroDivisionError("no such thing")

    monkeypatch.setattr(Look, "read", fails)
    shown = run("plan", folder, "-o", "plans", "--no-figure")
    assert shown.exit_code == Exit.BUG
    assert "3 files: ZeroDivisionError" in shown.stderr
    assert "Traceback" not in shown.output


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ([], "directory"),
        (["-o", "photos"], "another folder"),
        (["-o", "table.jpg"], "got a file"),
        (["-o", "none/plans"], "no folder"),
        (["-o", "plans", "--html", "x.html"], "for one photo"),
    ],
)
def test_where_a_folder_goes(folder: Path, here: Path, options: list[str], word: str) -> None:
    shown = run("plan", "photos", *options)
    assert shown.exit_code == Exit.BAD_INPUT
    assert word in shown.stderr
    assert not (here / "plans").exists()


def test_a_folder_without_photos(here: Path) -> None:
    Path("empty").mkdir()
    shown = run("plan", "empty", "-o", "plans")
    assert shown.exit_code == Exit.BAD_INPUT
    assert "got none" in shown.stderr


def test_images_of_one_stem_do_not_overwrite_each_other(here: Path) -> None:
    Path("photos").mkdir()
    for name in ("a.jpg", "a.png"):
        write(Path("photos", name), table())
    assert run("plan", "photos", "-o", "plans", "--no-figure").exit_code == Exit.VERIFIED
    assert {path.name for path in Path("plans").glob("*.json")} == {"a.jpg.plan.json", "a.png.plan.json"}


def test_photos_in_python(here: Path) -> None:
    for given in (table(), "table.jpg", Path("table.jpg"), perceive("table.jpg"), Look().read("table.jpg")):
        found = pscover.plan(given)
        assert (found.scene.garments, len(found.grasps)) == (2, 2)
        assert found.seen.origin.startswith("photo of 160 x 90 pixels, segmented by ")
    assert pscover.plan(Scene.of([[0, 1]]), required=0).seen.origin == "labels"
    with pytest.raises(pscover.UnknownName, match="classical"):
        pscover.plan(table(), segmenter="clasical")
    with pytest.raises(pscover.InvalidImage, match="8-bit"):
        pscover.plan(table().astype(float))


def test_the_segmenters_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = run("segmenters")
    assert shown.exit_code == 0
    for name in registry.names("segmenter"):
        assert name in shown.stdout
    monkeypatch.setattr("pscover.registry.missing", lambda found: found.requires)
    assert 'pip install "pscover[mobile-sam]"' in " ".join(run("segmenters").stdout.split())
    rows = json.loads(run("segmenters", "--json").stdout)["segmenters"]
    assert {"classical", "mobile-sam", "sam"} <= {row["name"] for row in rows}
    assert all(row["what"] and row["parameters"] and not row["installed"] for row in rows)


def test_weights_are_looked_for_and_checked(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSCOVER_MODELS", str(here / "weights"))
    monkeypatch.setenv("HOME", str(here))
    shown = run("models", "where")
    assert shown.exit_code == 0
    assert "not found" in shown.stdout
    assert str(here / "weights") in "".join(shown.stdout.split("\n")).replace(" ", "")
    shown = run("models", "check")
    assert shown.exit_code == Exit.BAD_INPUT
    assert "no weights found" in shown.stderr
    Path("weights").mkdir()
    wrong = here / "weights" / "mobile_sam.pt"
    wrong.write_bytes(b"no weights")
    where = json.loads(run("models", "where", "--json").stdout)
    assert where["weights"][0]["found"] == str(wrong)
    checked = run("models", "check", "--json")
    assert checked.exit_code == Exit.BAD_INPUT
    assert "SHA-256" in json.loads(checked.stdout)["weights"][0]["problem"]
    assert "no  " in run("models", "check").stdout
    shown = run("models", "export", "-o", "made")
    assert shown.exit_code in (Exit.BAD_INPUT, Exit.MISSING)
    assert shown.exit_code == Exit.MISSING or f"{wrong}: expected SHA-256" in shown.stderr, "it is looked for by its name"
    assert run("models", "export", "none.pt", "-o", "made").exit_code in (Exit.BAD_INPUT, Exit.MISSING)
    assert run("models", "export", wrong, "-o", wrong).exit_code == Exit.BAD_INPUT
    assert not Path("made").exists()
    shown = run("plan", "table.jpg", "--segmenter", "mobile-sam", "--no-figure")
    assert shown.exit_code in (Exit.BAD_INPUT, Exit.MISSING)
    assert shown.stderr.count("\n") == 1

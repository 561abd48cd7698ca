"""`pscover convert` and `pscover generate`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from pscover import Instance
from pscover.cli.app import app
from pscover.cli.fail import Exit
from pscover.encoding import encode_labels
from pscover.errors import InvalidImage
from pscover.generate.garments import garments
from pscover.generate.psc import psc_on_incidence, random_psc
from pscover.io import load_instance, save_instance


def run(*arguments: str | Path) -> Result:
    return CliRunner(env={"COLUMNS": "80"}).invoke(app, [str(a) for a in arguments])


@pytest.fixture
def cover(tmp_path: Path) -> Path:
    path = tmp_path / "cover.scp"
    save_instance(Instance.of([[1.0, 0.0, 1.0], [1.0, 1.0, 0.0]], required=0.5, cost=[3, 1, 1]), path)
    return path


@pytest.mark.parametrize("ending", [".json", ".npz", ".rail", ".txt"])
def test_conversion_keeps_the_problem(cover: Path, tmp_path: Path, ending: str) -> None:
    target = tmp_path / f"other{ending}"
    shown = run("convert", cover, target)
    assert shown.exit_code == 0, shown.output
    assert shown.stdout == ""
    assert str(target) in shown.stderr
    if ending != ".txt":
        assert load_instance(target).digest == load_instance(cover).digest


def test_a_model_as_mps(cover: Path, tmp_path: Path) -> None:
    target = tmp_path / "model.mps"
    assert run("convert", cover, target, "-f", "pairwise").exit_code in (0, Exit.BAD_INPUT)
    assert run("convert", cover, target, "--quiet").stderr == ""
    assert target.read_text().startswith("NAME pscover\n")


def test_the_layout_can_be_said(tmp_path: Path) -> None:
    path = tmp_path / "open.txt"
    path.write_text("3 3\n1 1 1\n1 2\n1 3\n2 1\n2 1\n3 2 3\n")
    by_rows, by_columns = tmp_path / "rows.json", tmp_path / "columns.json"
    shown = [run("convert", path, target, "--from", layout) for target, layout in ((by_rows, "scp"), (by_columns, "rail"))]
    assert {s.exit_code for s in shown} <= {0, Exit.BAD_INPUT}
    assert any(s.exit_code == 0 for s in shown) or all("read as" in s.stderr for s in shown)
    assert run("convert", path, by_rows, "--from", "doc").exit_code == Exit.BAD_INPUT


@pytest.mark.parametrize(
    ("target", "word"), [("x.doc", "ends in"), ("cover.scp", "replace an input"), ("none/x.json", "no folder"), (".", "")]
)
def test_a_target_that_cannot_be(cover: Path, target: str, word: str) -> None:
    shown = run("convert", cover, cover.parent / target)
    assert shown.exit_code == Exit.BAD_INPUT
    assert word in shown.stderr
    assert len(shown.stderr.splitlines()) == 1


def test_a_scene_as_labels(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    path = tmp_path / "table.png"
    shown = run("generate", "garments", "--count", "5", "--seed", "3", "-o", path)
    assert shown.exit_code == 0
    assert "5 garments" in shown.stderr
    assert np.array_equal(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), garments(5, 3).labels)


def test_a_scene_as_an_instance(tmp_path: Path) -> None:
    paths = [tmp_path / "table.json", tmp_path / "table.npz"]
    for path in paths:
        assert run("generate", "garments", "--count", "5", "--groups", "2", "--required", "0.6", "-o", path).exit_code == 0
    one, other = map(load_instance, paths)
    assert one.digest == other.digest
    assert one.elements == 5
    assert (one.required == 0.6).all()


def test_piles(tmp_path: Path) -> None:
    path = tmp_path / "pile.png"
    assert run("generate", "garments", "--count", "4", "--layout", "piled", "-o", path).exit_code == 0
    shown = run("generate", "garments", "--count", "4", "--layout", "piled", "--groups", "2", "-o", path)
    assert shown.exit_code == Exit.BAD_INPUT
    assert "groups" in shown.stderr


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--count", "-1"], "count"),
        (["--count", "400", "--width", "60", "--height", "60"], "finds no place"),
        (["--seed", "-1"], "--seed"),
        (["--width", "0"], "size"),
    ],
)
def test_scenes_that_cannot_be(tmp_path: Path, options: list[str], word: str) -> None:
    shown = run("generate", "garments", *options, "-o", tmp_path / "x.png")
    assert shown.exit_code == Exit.BAD_INPUT
    assert word in shown.stderr
    assert not list(tmp_path.iterdir())


def test_random_instances(tmp_path: Path) -> None:
    path = tmp_path / "random.npz"
    options = ["--elements", "6", "--candidates", "20", "--covers", "2", "--clique-size", "4", "--seed", "5"]
    assert run("generate", "psc", *options, "-o", path).exit_code == 0
    assert load_instance(path).digest == random_psc(6, 20, covers=2, clique_size=4, seed=5).digest


def test_random_instances_on_an_incidence(cover: Path, tmp_path: Path) -> None:
    path = tmp_path / "random.json"
    assert run("generate", "psc", "--on", cover, "--required", "0.8", "-o", path).exit_code == 0
    assert load_instance(path).digest == psc_on_incidence(load_instance(cover), required=0.8).digest
    assert run("generate", "psc", "--on", cover, "--elements", "3", "-o", path).exit_code == Exit.BAD_INPUT


def test_labels_beyond_16_bits_are_refused() -> None:
    with pytest.raises(InvalidImage, match="65535"):
        encode_labels(np.array([[70000]]))

"""Animations: frames, palettes, marks that follow the plan, and the command that films an episode."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("PIL")
pytest.importorskip("numba")
from PIL import Image

from pscover.cli.app import app
from pscover.errors import InvalidSettings, PscoverError
from pscover.experiment.trial import Trial, run
from pscover.robot import Frame, Pose
from pscover.sim.film_strip import BAND, NOW, Mark, Strip


def grey(value: int) -> Frame:
    return Frame(rgb=np.full((80, 120, 3), value, dtype=np.uint8))


def read(content: bytes) -> list[tuple[np.ndarray, int]]:
    """Frames as RGB, and the milliseconds for which each is shown."""
    found = []
    with Image.open(io.BytesIO(content)) as image:
        for number in range(getattr(image, "n_frames", 1)):
            image.seek(number)
            found.append((np.asarray(image.convert("RGB")).astype(int), image.info["duration"]))
    return found


def test_a_strip_keeps_its_frames_and_their_time() -> None:
    strip = Strip(jaw=40, seconds=0.1)
    strip.hold(9.0)
    strip.show(grey(40))
    strip.show(grey(200))
    strip.words = "so far"
    strip.hold(1.5)
    frames = read(strip.content())
    assert [milliseconds for _, milliseconds in frames] == [100, 100, 1500]
    assert [int(rgb[20, 20, 0]) for rgb, _ in frames] == pytest.approx([40, 200, 200], abs=3)
    assert frames[0][0].shape == (80 + BAND, 120, 3)
    assert frames[1][0][80:].min() > 240
    assert frames[2][0][80:].min() < 120


def test_a_grasp_is_drawn_along_its_jaw() -> None:
    strip = Strip(jaw=40, seconds=0.1, marks=(Mark(number=3, pose=Pose(x=60, y=40, theta=np.pi / 2), now=True),))
    strip.show(grey(200))
    ((rgb, _),) = read(strip.content())
    red = np.abs(rgb - NOW).max(axis=2) < 40
    rows, columns = np.nonzero(red)
    assert (rows.min(), rows.max()) == pytest.approx((20, 60), abs=2)
    assert np.ptp(columns) < 20
    assert not red[40, 60 + 12 :].any()


def test_nothing_filmed_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(PscoverError, match="at least one frame"):
        Strip(jaw=40, seconds=0.1).save(tmp_path / "nothing.gif")
    assert not list(tmp_path.iterdir())


def test_a_world_without_physics_has_no_film(tmp_path: Path) -> None:
    with pytest.raises(InvalidSettings, match="cloth"):
        run(Trial(policy="random", world="tabletop", film=str(tmp_path / "flat.gif")))


@pytest.mark.parametrize("more", [("--episodes", "2"), ("--policy", "random,height"), ("--world", "tabletop")])
def test_one_episode_is_filmed_at_a_time(tmp_path: Path, more: tuple[str, ...]) -> None:
    line = ["simulate", "--policy", "random", "--episodes", "1", "-o", str(tmp_path / "out"), "--film", "x.gif", *more]
    done = CliRunner().invoke(app, line)
    assert done.exit_code == 2
    assert "--film" in done.stderr
    assert not (tmp_path / "out").exists()

"""Pictures of plans: they are drawn, say what the plan says, and survive what users call their garments."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pscover import InvalidSettings, MissingDependency, PscoverError, Status
from pscover.generate.garments import garments
from pscover.perception.depth import Depth
from pscover.perception.table_plane import TablePlane
from pscover.planning import Plan, plan
from pscover.scene import Scene
from pscover.seen import Seen

matplotlib = pytest.importorskip("matplotlib")

from pscover.figures.plan import PlanStyle, headline, plan_figure, render_plan, save_plan_figure  # noqa: E402
from pscover.figures.style import palette  # noqa: E402


@pytest.fixture(scope="module")
def ten() -> Plan:
    return plan(garments(10))


def size(content: bytes) -> tuple[int, int]:
    assert content.startswith(b"\x89PNG")
    return int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big")


def test_the_picture_is_as_wide_as_asked(ten: Plan) -> None:
    assert size(render_plan(ten))[0] == 1200
    assert size(render_plan(ten, style=PlanStyle(width=800)))[0] == 800
    assert render_plan(ten) == render_plan(ten)


def test_every_grasp_is_an_ellipse_where_it_belongs_with_its_number(ten: Plan) -> None:
    from matplotlib.patches import Ellipse
    from matplotlib.text import Annotation

    view = plan_figure(ten).axes[0]
    shown = [patch for patch in view.patches if isinstance(patch, Ellipse)]
    assert [tuple(patch.center) for patch in shown] == [(grasp.x, grasp.y) for grasp in ten.grasps]
    assert [patch.angle for patch in shown] == pytest.approx([math.degrees(grasp.theta) for grasp in ten.grasps])
    assert {(patch.width, patch.height) for patch in shown} == {(40.0, 12.0)}
    numbers = [text for text in view.texts if text.get_text().isdigit()]
    assert [text.get_text() for text in numbers] == [str(k + 1) for k in range(len(ten.grasps))]
    assert [text.xy for text in numbers if isinstance(text, Annotation)] == [(grasp.x, grasp.y) for grasp in ten.grasps]


def test_the_list_shows_every_garment_and_how_surely_it_goes(ten: Plan) -> None:
    panel = plan_figure(ten).axes[1]
    assert [label.get_text() for label in panel.get_yticklabels()] == list(ten.scene.names)
    assert [text.get_text() for text in panel.texts] == [f"{covered:.2f}" for covered in ten.coverage]


def test_words_for_every_outcome(ten: Plan) -> None:
    assert headline(ten)[:2] == ("10 grasps for 10 garments", "optimal: no plan from these candidates needs fewer grasps")
    ribbon = np.zeros((60, 90), dtype=int)
    ribbon[20:22, 10:80] = 1
    short = plan(ribbon)
    assert headline(short)[0] == "1 grasp for 1 garment"
    assert "the requirement of 1 garment is out of reach" in headline(short)[1]
    feasible = replace(ten, result=replace(ten.result, status=Status.FEASIBLE), bound=9.0)
    assert headline(feasible)[1] == "feasible: every plan from these candidates needs at least 9"
    assert headline(replace(feasible, bound=-math.inf))[1] == "feasible: how many are needed is not known"
    unknown = replace(short, strict=replace(ten.result, status=Status.UNKNOWN))
    assert headline(unknown)[1] == "1 garment left short: no plan that meets every requirement was found in time"


@pytest.mark.parametrize(
    "scene",
    [
        Scene.of(np.zeros((20, 30), dtype=int)),
        Scene.of([[1]]),
        Scene.of(np.ones((300, 5), dtype=int)),
        Scene.of(np.ones((3, 700), dtype=int)),
        Scene.of(np.ones((50, 60), dtype=int), basket=(500.0, -90.0)),
        Scene.of([[1, 2]], names=["cost $5_{", "a name that is very much longer than the space there is"]),
        Scene.of(np.ones((50, 60), dtype=int), photo=np.zeros((50, 60, 3), dtype=np.uint8)),
        Scene.of(np.kron(np.arange(60).reshape(6, 10), np.ones((12, 12), dtype=int))),
    ],
    ids=["empty", "pixel", "tall", "wide", "basket outside", "names", "photo", "many"],
)
def test_any_plan_can_be_drawn(scene: Scene) -> None:
    assert size(render_plan(plan(scene, backend="greedy", time=2)))[0] == 1200


@pytest.mark.parametrize(("suffix", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF")])
def test_the_suffix_says_which_kind(tmp_path: Path, ten: Plan, suffix: str, start: bytes) -> None:
    file = tmp_path / f"plan{suffix}"
    save_plan_figure(ten, file)
    assert file.read_bytes().startswith(start)


def test_what_cannot_be_written(tmp_path: Path, ten: Plan) -> None:
    with pytest.raises(InvalidSettings, match="expected one of png, svg, pdf, got 'gif'"):
        save_plan_figure(ten, tmp_path / "plan.gif")
    with pytest.raises(PscoverError, match="no folder"):
        save_plan_figure(ten, tmp_path / "none" / "plan.png")
    with pytest.raises(InvalidSettings, match="width"):
        PlanStyle(width=10)


def test_threads_draw_at_the_same_time(ten: Plan) -> None:
    with ThreadPoolExecutor(3) as pool:
        drawn: list[Any] = list(pool.map(render_plan, [ten] * 4))
    assert len(set(drawn)) == 1


def test_without_matplotlib_the_pip_line_is_given(ten: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    with pytest.raises(MissingDependency, match=r'pip install "pscover\[figures\]"'):
        plan_figure(ten)


def with_depth(photo: bool = True) -> Plan:
    """A plan for a low and a high garment; 40 cm of wrong depth at one pixel."""
    labels, depth = np.zeros((60, 120), dtype=int), np.full((60, 120), 1.0)
    labels[10:50, 10:50], labels[10:50, 70:110] = 1, 2
    depth[labels == 1], depth[labels == 2], depth[0, 0] = 0.98, 0.93, 0.6
    picture = np.full((60, 120, 3), 120, dtype=np.uint8) if photo else None
    return plan(Scene.of(labels, photo=picture, names=["low $", "high_"]), depth=depth)


def test_heights_are_shown_over_the_same_extent_with_a_scale_in_centimetres() -> None:
    found = with_depth()
    main, _, heights, scale = plan_figure(found).axes
    assert heights.get_title(loc="left") == "height above the table"
    assert heights.get_images()[0].get_extent() == main.get_images()[0].get_extent()
    shown = heights.get_images()[0].get_array()
    assert shown is not None
    assert np.asarray(shown)[30, 90] == pytest.approx(7, abs=1e-3)
    assert heights.get_images()[0].get_clim() == (0, 8), "one wrong pixel does not set the scale"
    assert scale.get_ylabel() == "cm above the table"
    numbers = [text.get_text() for text in heights.texts if text.get_text().isdigit()]
    assert numbers == [str(k + 1) for k in range(len(found.grasps))]
    assert size(render_plan(found))[0] == 1200


@pytest.mark.parametrize("photo", [True, False])
def test_the_picture_of_a_scene_shows_heights(photo: bool) -> None:
    from pscover.figures.scene import render_scene, scene_figure

    found = with_depth(photo).seen
    titles = [axes.get_title(loc="left") for axes in scene_figure(found).axes if axes.get_title(loc="left")]
    assert titles == (["photo", "2 segments", "height", "mean height and top, cm"] if photo else ["2 segments", "height"])
    if photo:
        bars = scene_figure(found).axes[-1]
        assert [text.get_text() for text in bars.texts] == ["2.0, top 2.0", "7.0, top 7.0"]
    assert size(render_scene(found))[0] == 1200


def test_heights_of_any_shape_can_be_drawn() -> None:
    from pscover.figures.scene import render_scene

    for shape in ((1, 1), (300, 5), (3, 700)):
        labels = np.ones(shape, dtype=int)
        for picture in (None, np.zeros((*shape, 3), dtype=np.uint8)):
            found = plan(Scene.of(labels, photo=picture), depth=Depth(image=labels * 0.9, table=TablePlane.level(1)), time=2)
            assert size(render_plan(found))[0] == 1200
            assert size(render_scene(found.seen))[0] == 1200
    many = np.kron(np.arange(100).reshape(10, 10), np.ones((6, 6), dtype=int))
    seen = Seen.whole(Scene.of(many, photo=np.zeros((60, 60, 3), dtype=np.uint8)))
    heights = Depth(image=np.full((60, 60), 0.9), table=TablePlane.level(1)).heights(seen.grid)
    assert size(render_scene(replace(seen, heights=heights)))[0] == 1200


def test_colours_are_colours() -> None:
    colours = palette(40)
    assert colours.shape == (40, 3)
    assert colours.min() >= 0
    assert colours.max() <= 1
    assert len(np.unique(colours[:36], axis=0)) == 36
    assert palette(0).shape == (0, 3)

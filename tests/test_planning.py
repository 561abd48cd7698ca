"""From label image to plan and plan document."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import pscover
from pscover import InvalidImage, InvalidInstance, PscoverError, Status, UnknownName
from pscover.generate.garments import garments
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.sampling import Sampling
from pscover.grasps import ordered
from pscover.instance import Instance
from pscover.plan_document import encode_plan, save_plan
from pscover.planning import as_seen, best_effort, plan
from pscover.scene import Scene
from pscover.seen import Seen
from pscover.verify import verify

PAPER = Path(__file__).parents[1] / "instances" / "paper"


def thin_and_thick() -> NDArray[np.int32]:
    """A ribbon of which no grasp holds enough, and a towel."""
    labels = np.zeros((100, 200), dtype=np.int32)
    labels[10:13, 10:60] = 1
    labels[50:90, 100:150] = 2
    return labels


def test_grasps_are_executed_by_increasing_distance_to_the_basket() -> None:
    for basket in ((469.0, 141.0), (0.0, 0.0), (600.0, -50.0)):
        found = plan(Scene.of(garments(10).labels, basket=basket))
        distances = [math.dist((grasp.x, grasp.y), basket) for grasp in found.grasps]
        assert len(distances) >= 10
        assert distances == sorted(distances)
        assert distances == [grasp.distance for grasp in found.grasps]


def test_grasps_at_one_distance_keep_the_order_of_candidates() -> None:
    scene = Scene.of(np.ones((41, 41), dtype=int), basket=(20, 20))
    instance = pscover.Instance.of(
        np.full((1, 4), 0.5), meta=pscover.Meta(poses=np.array([[10.0, 20, 0], [20, 10, 0], [20, 20, 0], [30, 20, 0]]))
    )
    assert [grasp.candidate for grasp in ordered(Seen.whole(scene), instance, [3, 0, 2, 1])] == [2, 0, 1, 3]


def test_a_plan_is_what_was_solved() -> None:
    found = plan(garments(10))
    assert found.result.status is Status.OPTIMAL
    assert found.strict is None
    assert found.unmet == ()
    assert found.bound == len(found.grasps) == found.result.objective
    assert found.result.chosen is not None
    assert sorted(grasp.candidate for grasp in found.grasps) == found.result.chosen.tolist()
    assert (found.coverage >= 0.7 - 1e-9).all()
    assert found.expected_removed == pytest.approx(found.coverage.sum())
    for grasp in found.grasps:
        column = found.instance.probability[:, [grasp.candidate]].toarray().ravel()
        assert {removed.garment: removed.probability for removed in grasp.removes} == {
            int(j): column[j] for j in np.flatnonzero(column)
        }
        assert [removed.probability for removed in grasp.removes] == sorted(column[column > 0], reverse=True)
    verify(found.instance, found.result)


def test_garments_out_of_reach_are_named_and_the_rest_is_planned() -> None:
    found = plan(thin_and_thick())
    assert found.strict is not None
    assert found.strict.status is Status.INFEASIBLE
    assert found.result.formulation == "elastic"
    assert found.unmet == (0,)
    assert found.coverage[1] >= 0.7
    # The ribbon gets the best of its candidates all the same.
    assert found.coverage[0] == pytest.approx(found.instance.probability[[0], :].max())
    assert found.bound == math.inf


def test_what_can_be_a_scene(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    labels = thin_and_thick()
    file = tmp_path / "labels.png"
    file.write_bytes(cv2.imencode(".png", labels.astype(np.uint16))[1].tobytes())
    for given in (file, str(file), labels, labels.tolist()):
        assert (as_seen(given).scene.labels == labels).all()
    with pytest.raises(InvalidImage, match="no such file"):
        plan(tmp_path / "none.png")


def test_nothing_on_the_table() -> None:
    found = plan(np.zeros((30, 40), dtype=int))
    assert found.result.status is Status.OPTIMAL
    assert (found.grasps, found.unmet, found.expected_removed) == ((), (), 0.0)


def test_garments_of_one_pixel_and_at_the_border() -> None:
    labels = np.zeros((30, 30), dtype=np.uint16)
    labels[0, 0], labels[29, 29], labels[0, 29], labels[15, 15] = 1, 300, 65535, 9
    found = plan(labels, predictor=Ellipse(half=0.1), sampling=Sampling(reach=5))
    assert found.scene.names == ("garment 1", "garment 9", "garment 300", "garment 65535")
    assert found.unmet == ()
    assert next((grasp.x, grasp.y) for grasp in found.grasps) in {(29.0, 0.0), (29.0, 29.0), (15.0, 15.0)}
    short = plan(labels)
    assert short.unmet == (0, 1, 2, 3)


def test_a_thousand_garments() -> None:
    labels = np.kron(np.arange(1, 1001).reshape(25, 40), np.pad(np.ones((20, 20), dtype=int), 3))
    found = plan(labels, sampling=Sampling(points=1, orientations=2), required=0.5, backend="greedy")
    assert found.instance.elements == 1000
    assert found.result.has_plan
    assert found.coverage.min() >= 0.5


def test_the_seed_is_that_of_the_draw_too() -> None:
    scene = garments(5)
    first, again, other = (plan(scene, seed=seed) for seed in (1, 1, 2))
    assert first.grasps == again.grasps
    assert first.instance.digest != other.instance.digest
    assert first.result.settings.seed == 1


def test_settings_reach_their_stage() -> None:
    found = plan(garments(5), conflicts="distance", required=0.4, backend="greedy", formulation="pairwise")
    assert (found.result.backend, found.result.formulation) == ("greedy", "pairwise")
    assert found.instance.required.tolist() == [0.4] * 5
    assert found.result.status in (Status.FEASIBLE, Status.OPTIMAL)


def test_a_bound_on_something_else_is_not_shown_as_one_on_grasps() -> None:
    found = plan(garments(5), formulation="elastic")
    assert found.strict is None
    assert found.bound == -math.inf


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(UnknownName, match="'highs'"):
        plan(garments(5), backend="higs")
    with pytest.raises(InvalidInstance, match="required"):
        plan(garments(5), required=1.5)
    with pytest.raises(PscoverError, match="time"):
        plan(garments(5), time=0)


def test_the_document_says_what_the_plan_says(tmp_path: Path) -> None:
    scene = Scene.of(thin_and_thick(), names=["ribbon", "towel"], pixels_per_cm=2.0, source="a test")
    found = plan(scene, sampling=Sampling(), predictor=Ellipse())
    document = json.loads(encode_plan(found))
    assert document["schema"] == "pscover.plan/1"
    assert (document["status"], document["formulation"], document["bound"]) == ("infeasible", "elastic", None)
    assert document["unmet"] == ["ribbon"]
    assert (document["width"], document["height"], document["source"]) == (200, 100, "a test")
    assert [(garment["name"], garment["label"]) for garment in document["garments"]] == [("ribbon", 1), ("towel", 2)]
    assert len(document["grasps"]) == len(found.grasps)
    for written, grasp in zip(document["grasps"], found.grasps, strict=True):
        assert (written["x"], written["y"], written["theta"]) == (grasp.x, grasp.y, grasp.theta)
        assert (written["x_cm"], written["y_cm"]) == (grasp.x / 2, grasp.y / 2)
        assert written["removes"][0]["probability"] == grasp.removes[0].probability
    file = tmp_path / "plan.json"
    save_plan(found, file)
    assert file.read_bytes() == encode_plan(found)
    with pytest.raises(PscoverError, match="no folder"):
        save_plan(found, tmp_path / "none" / "plan.json")


def test_a_backend_that_cannot_come_close_leaves_that_to_highs() -> None:
    found = plan(thin_and_thick(), backend="greedy")
    assert (found.result.backend, found.result.formulation) == ("highs", "elastic")
    assert found.unmet == (0,)


def test_without_time_the_plan_is_still_the_best_known() -> None:
    found = plan(garments(20, layout="piled"), time=1e-3)
    assert len(found.grasps) > 5
    assert len(found.instance.conflicts.broken_by([grasp.candidate for grasp in found.grasps])) == 0
    assert len(found.unmet) < 20


def test_searches_begin_from_the_start_that_is_given() -> None:
    def last(instance: Instance) -> tuple[int, ...]:
        return (instance.candidates - 1,)

    for labels, searches in ((thin_and_thick()[50:, 100:], 1), (thin_and_thick(), 2)):
        found = plan(labels, start=last)
        solved = [found.result] if found.strict is None else [found.strict, found.result]
        assert [result.settings.start for result in solved] == [last(found.instance)] * searches


def test_best_effort_is_free_of_conflicts_and_never_idle() -> None:
    instance = plan(garments(8, layout="piled"), backend="greedy", required=0.5).instance.require(0.99)
    chosen = best_effort(instance)
    assert len(instance.conflicts.broken_by(chosen)) == 0
    assert (instance.coverage(chosen) > 0).all()


@pytest.mark.skipif(not PAPER.is_dir(), reason="the sources are not here")
def test_the_shipped_series_is_what_its_command_writes() -> None:
    from pscover.generate.paper_series import series
    from pscover.io import load_instance

    for name, instance in series():
        shipped = load_instance(PAPER / f"{name}.json")
        assert shipped.meta.name == name
        assert shipped.digest == instance.digest

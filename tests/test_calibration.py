"""Fits find the numbers that grasps were made with, and say how sure that is."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from pscover import InvalidResult, InvalidSettings, registry
from pscover.calibration.fit import PAPER, Pairs, fit_ellipse, fit_logistic, pairs
from pscover.calibration.logged import Logged, folders, logged, split
from pscover.cli.app import app
from pscover.execution.declutter import declutter
from pscover.execution.episode import Header, Recorder
from pscover.execution.events import Captured
from pscover.execution.sight import PhotoEyes
from pscover.execution.tabletop import ColourEyes, small_table
from pscover.experiment.trial import Trial, policy_of, run
from pscover.grasping.calibrated import Calibrated, read_predictor
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.features import FEATURES, features
from pscover.robot import Frame
from pscover.scene import Scene

pytest.importorskip("cv2")
TRUE = Calibrated(major_cm=6.0, minor_cm=4.0, half_cm2=2.0)


def simulated(count: int, *, slope: float = 0.0, seed: int = 0) -> list[Logged]:
    """Grasps whose outcomes are drawn from known numbers; with a slope, high garments are harder to remove."""
    random = np.random.default_rng(seed)
    grasps = []
    for k in range(count):
        labels = np.zeros((70, 110), dtype=int)
        top, left = random.integers(0, 30), random.integers(0, 40)
        labels[top : top + 40, left : left + 30] = 1
        labels[30:60, left + 30 : left + 70] = 2
        scene = Scene.of(labels)
        pose = np.array([random.uniform(5, 105), random.uniform(5, 65), random.uniform(-1.5, 1.5)])
        heights = np.full(scene.shape, random.uniform(0, 0.1))
        p = TRUE.at(4.7).probability(scene, pose[None]).toarray()[:, 0]
        height = heights[round(pose[1]), round(pose[0])]
        logits = np.log(np.maximum(p, 1e-12) / (1 - p)) + slope * (height - 0.05)
        removed = random.random(2) < np.where(p > 0, 1 / (1 + np.exp(-logits)), 0)
        grasps.append(Logged(episode=f"{k % 8}", scene=scene, pose=pose, removed=removed, heights=heights))
    return grasps


def test_the_fit_finds_the_numbers_that_made_the_grasps() -> None:
    found = fit_ellipse(simulated(350))
    assert math.sqrt(found.major_cm * found.minor_cm) == pytest.approx(math.sqrt(24), rel=0.25)
    assert found.half_cm2 == pytest.approx(2.0, rel=0.6)
    fresh = simulated(200, seed=1)
    assert pairs(fresh, found).log_loss < pairs(fresh, PAPER).log_loss - 0.02
    assert pairs(fresh, found).log_loss == pytest.approx(pairs(fresh, TRUE).log_loss, abs=0.03)


def test_few_grasps_without_a_surprise_leave_the_jaw_its_size() -> None:
    grasps = []
    for grasp in simulated(30):
        touched = PAPER.at(4.7).probability(grasp.scene, grasp.pose[None]).toarray()[:, 0] > 0
        grasps.append(replace(grasp, removed=touched))
    found = fit_ellipse(grasps)
    assert 0.02 < found.half_cm2 < PAPER.half_cm2 / 2
    assert found.major_cm == pytest.approx(PAPER.major_cm, rel=0.6)
    assert found.minor_cm == pytest.approx(PAPER.minor_cm, rel=0.6)


def test_outcomes_that_are_all_alike_bound_the_weights() -> None:
    grasps = [replace(grasp, removed=np.ones(2, dtype=np.bool_)) for grasp in simulated(30)]
    found = fit_logistic(grasps, PAPER)
    assert 0 < found.weights[0] < 5
    assert max(map(abs, found.weights)) < 5


def test_the_logistic_model_finds_what_the_ellipse_cannot_know() -> None:
    grasps, fresh = simulated(350, slope=-60.0), simulated(200, slope=-60.0, seed=1)
    ellipse = fit_ellipse(grasps)
    logistic = fit_logistic(grasps, ellipse)
    assert pairs(fresh, logistic).log_loss < pairs(fresh, ellipse).log_loss - 0.03
    slope = logistic.weights[1 + FEATURES.index("height")] / logistic.scales[FEATURES.index("height")]
    assert slope == pytest.approx(-60, rel=0.4)
    others = [abs(weight) for weight, name in zip(logistic.weights[1:], FEATURES, strict=True) if name != "height"]
    assert max(others) < 1.0


def test_without_weights_the_extension_is_the_ellipse() -> None:
    grasp = simulated(1)[0]
    plain = Calibrated(major_cm=8.0, minor_cm=3.0, half_cm2=4.0)
    size = len(FEATURES)
    extended = replace(plain, weights=(0.0,) * (size + 1), means=(0.0,) * size, scales=(1.0,) * size)
    poses = np.array([[30.0, 30, 0.3], [60, 40, 1.0], [-50, -50, 0]])
    expected = plain.at(4.7).probability(grasp.scene, poses).toarray()
    for heights in (None, grasp.heights):
        found = extended.at(4.7, heights)
        np.testing.assert_allclose(found.probability(grasp.scene, poses).toarray(), expected, atol=1e-9)
        assert found.axes == pytest.approx((37.6, 14.1))


def test_the_papers_numbers_are_the_papers_predictor() -> None:
    assert PAPER.at(4.7) == pytest.approx(Ellipse()) or PAPER.at(4.7).axes == pytest.approx((40, 12))
    scene, poses = simulated(1)[0].scene, np.array([[30.0, 30, 0.3]])
    ours, papers = (predictor.probability(scene, poses).toarray() for predictor in (PAPER.at(4.7), Ellipse()))
    np.testing.assert_allclose(ours, papers, rtol=1e-6)


def test_features_are_what_they_are_called() -> None:
    labels = np.zeros((47, 94), dtype=int)
    labels[:, :47], labels[:, 47:70] = 1, 2
    scene, poses = Scene.of(labels), np.array([[40.0, 23, 0.0]])
    heights = np.full(scene.shape, 0.07)
    areas = Ellipse().areas(scene, poses)
    found = features(scene, poses, areas, heights)
    assert found.shape == (2, len(FEATURES))
    np.testing.assert_allclose(np.exp(found[:, 0]) * 4.7**2, areas.data)
    np.testing.assert_allclose(np.exp(found[:, 1]), [100.0, 47 * 23 / 4.7**2])
    assert found[:, 2].tolist() == [2, 2]
    np.testing.assert_allclose(found[:, 3] * 4.7, [7, -7])
    np.testing.assert_allclose(found[:, 4], 0.07)


def test_scores_are_what_they_are_called() -> None:
    found = Pairs(probability=np.array([0.8, 0.8, 0.1]), removed=np.array([True, False, False]))
    assert found.log_loss == pytest.approx(-(math.log(0.8) + math.log(0.2) + math.log(0.9)) / 3)
    assert found.brier == pytest.approx((0.04 + 0.64 + 0.01) / 3)
    sure = Pairs(probability=np.array([0.0]), removed=np.array([True]))
    assert sure.log_loss < 6


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root: Path = tmp_path_factory.mktemp("records")
    for seed in range(7):
        run(Trial(policy="segment-replan", options=(("backend", "greedy"),), seed=seed, world="tabletop", record=str(root)))
    return root


def test_records_say_what_each_grasp_took(tmp_path: Path) -> None:
    table, eyes = small_table(), ColourEyes()
    with Recorder(tmp_path, Header(policy="segment-replan")) as record:
        for event in declutter(table, table, registry.policy("segment-replan"), eyes=eyes):
            record.write(event)
    grasps = list(logged(folders(tmp_path)))
    assert len(grasps) >= 2
    assert grasps[0].scene.garments == 3
    assert sum(int(grasp.removed.sum()) for grasp in grasps) == 3
    assert grasps[0].heights is not None
    assert grasps[0].heights.max() == pytest.approx(0.04, abs=1e-6)
    x, y, _ = grasps[0].pose
    assert grasps[0].scene.segments[round(y), round(x)] in np.flatnonzero(grasps[0].removed)


@pytest.mark.parametrize("measured", [True, False])
def test_logged_heights_are_those_that_policies_see(tmp_path: Path, measured: bool) -> None:
    table, random = small_table(), np.random.default_rng(0)

    class Noisy:
        def capture(self) -> Frame:
            frame = table.capture()
            assert frame.depth is not None
            depth = (frame.depth + 0.002 * random.standard_normal(frame.shape)) * measured
            return Frame(rgb=frame.rgb, depth=depth.astype(np.float32))

    frames = []
    with Recorder(tmp_path, Header(policy="segment-replan")) as record:
        for event in declutter(table, Noisy(), registry.policy("segment-replan"), eyes=ColourEyes()):
            record.write(event)
            if isinstance(event, Captured):
                frames.append(event.frame)
    heights = next(logged([tmp_path])).heights
    if not measured:
        assert heights is None
        return
    assert heights is not None
    np.testing.assert_array_equal(heights, PhotoEyes().heights(frames[0]))
    assert np.median(heights[:8]) < 0.002


def test_pictures_of_another_shape_are_named(tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    table = small_table()
    with Recorder(tmp_path, Header(policy="segment")) as record:
        first, *rest = declutter(table, table, registry.policy("segment"), eyes=ColourEyes())
        assert isinstance(first, Captured)
        for event in (Captured(frame=Frame(rgb=first.frame.rgb[:50]), cloth=1), *rest):
            record.write(event)
    with pytest.raises(InvalidResult, match="of one shape"):
        list(logged(folders(tmp_path)))


def test_whole_episodes_are_held_out(records: Path) -> None:
    grasps = list(logged(folders(records)))
    fitting, testing = split(grasps, 0.5)
    assert {grasp.episode for grasp in fitting}.isdisjoint(grasp.episode for grasp in testing)
    assert len({grasp.episode for grasp in testing}) == 4
    assert len(fitting) + len(testing) == len(grasps)
    with pytest.raises(InvalidResult, match="at least 2 episodes"):
        split([grasp for grasp in grasps if grasp.episode == grasps[0].episode], 0.5)


def calibrate(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["calibrate", *map(str, arguments)])


def test_the_command_fits_draws_and_is_taken_by_policies(records: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    predictor, figure = tmp_path / "predictor.json", tmp_path / "reliability.png"
    done = calibrate(records, "-o", predictor, "--figure", figure)
    assert done.exit_code == 0, done.output
    assert "held out" in done.stdout
    assert figure.stat().st_size > 5000
    again = calibrate(records, "-o", tmp_path / "again.json", "--json", "-q")
    document = json.loads(again.stdout)
    assert (tmp_path / "again.json").read_bytes() == predictor.read_bytes()
    losses = {name: model["log_loss"] for name, model in document["models"].items()}
    assert losses["logistic"]["fitted"] <= losses["ellipse"]["fitted"] + 1e-6
    assert losses["ellipse"]["fitted"] <= losses["paper"]["fitted"]
    fitted = read_predictor(predictor)
    for name in ("segment", "consolidation", "hybrid-height", "segment-all"):
        policy: Any = policy_of(Trial(policy=name, predictor=fitted))
        assert policy.cycle.predictor == fitted
    assert policy_of(Trial(policy="random", predictor=fitted)) == registry.policy("random")
    for model in ("ellipse", "logistic"):
        calibrate(records, "-o", predictor, "--model", model, "-q")
        trial = Trial(
            policy="segment", options=(("backend", "greedy"),), world="tabletop", predictor=read_predictor(predictor)
        )
        assert run(trial)[0].reason == "clear"


def test_records_to_test_with_may_lie_elsewhere(records: Path, tmp_path: Path) -> None:
    places = [shutil.copytree(place, tmp_path / "test" / place.name) for place in folders(records)[:3]]
    done = calibrate(records, "--test", tmp_path / "test", "-o", tmp_path / "p.json", "--json", "-q")
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    fitting, testing = list(logged(folders(records))), list(logged(places))
    assert (document["episodes"], document["grasps"]) == (10, len(fitting) + len(testing))
    assert document["models"]["ellipse"]["half_cm2"] == fit_ellipse(fitting).half_cm2
    assert document["models"]["paper"]["log_loss"]["held_out"] == pairs(testing, PAPER).log_loss
    done = calibrate(records, "--test", tmp_path / "nowhere", "-o", tmp_path / "q.json")
    assert (done.exit_code, (tmp_path / "q.json").exists()) == (2, False)
    assert "expected records" in done.stderr


def test_mistakes_are_one_line(records: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for arguments, message in (
        ((tmp_path / "empty", "-o", tmp_path / "p.json"), "expected records"),
        ((tmp_path / "nowhere", "-o", tmp_path / "p.json"), "expected records"),
        ((records, "-o", tmp_path / "p.txt"), ".json"),
        ((next(records.rglob("0000")), "-o", tmp_path / "p.json"), "at least 2 episodes"),
    ):
        done = calibrate(*arguments)
        assert done.exit_code == 2
        assert message in done.stderr
        assert done.stderr.count("\n") == 1
    assert not (tmp_path / "p.json").exists()


@pytest.mark.parametrize(
    ("content", "match"),
    [
        ("", "expected a predictor"),
        ('{"major_cm": 3}', "expected a predictor"),
        ('{"major_cm": -3, "minor_cm": 1, "half_cm2": 1}', "major_cm"),
        ('{"major_cm": 3, "minor_cm": 1, "half_cm2": 1, "weights": [1, 2]}', "weights"),
    ],
)
def test_damaged_predictors_are_named(tmp_path: Path, content: str, match: str) -> None:
    path = tmp_path / "predictor.json"
    path.write_text(content)
    with pytest.raises(InvalidSettings, match=match):
        read_predictor(path)

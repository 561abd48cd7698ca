"""Cloth, camera, perception, policy and arm together: small tables cleared from the first picture to the last."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("numba")
pytest.importorskip("cv2")
from PIL import Image

from pscover.execution.declutter import declutter
from pscover.execution.events import Decided, Ended, Event, Moved, Reason
from pscover.experiment.cloth_world import ClothWorld
from pscover.experiment.filming import filmed
from pscover.experiment.worlds import TRUTH, Sorting
from pscover.policies.consolidation import Consolidation
from pscover.policies.segment import Segment
from pscover.policy import Place, Policy
from pscover.sim import Gripper, Material, World, WorldSettings
from pscover.sim.wardrobe import wardrobe

# Coarse cloth, and a jaw that reaches it: what is tested here is no matter of fine folds.
COARSE = WorldSettings(material=Material(spacing=0.03, scale=0.6), gripper=Gripper(tip=0.004))


def apart(segmenter: str) -> ClothWorld:
    """Two small garments, flat and apart."""
    garments = tuple(garment for garment in wardrobe(COARSE.material.scale) if garment.name in ("hat", "underwear"))
    assert len(garments) == 2
    world = World.of(garments, COARSE)
    cloth = world.cloth
    for g in range(2):
        own = slice(int(cloth.start[g]), int(cloth.start[g + 1]))
        cloth.position[own, :2] += (0.3 + 0.4 * g, 0.3) - cloth.position[own, :2].mean(axis=0)
        cloth.position[own, 2] = world.arm.law.thickness / 2
    cloth.before[:] = cloth.anchor[:] = cloth.position
    return ClothWorld.of(world, segmenter=segmenter)


def cleared(world: ClothWorld, policy: Policy) -> list[Event]:
    return list(declutter(Sorting(world.robot), world.camera, policy, eyes=world.eyes))


def test_a_plan_from_pictures_clears_the_table() -> None:
    world = apart("classical")
    events = cleared(world, Segment())
    assert isinstance(events[-1], Ended)
    assert events[-1].reason == Reason.CLEAR
    assert (world.count().on_table, world.count().in_basket) == (0, 2)
    plans = [event.plan for event in events if isinstance(event, Decided) and event.plan is not None]
    assert plans[0].seen.scene.garments == 2
    assert world.seconds() > 0


def test_garments_are_gathered_on_film(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pscover.experiment.filming.FRAMES", 1.0)
    world = apart(TRUTH)
    with filmed(world, "consolidation", tmp_path / "gathered.gif") as note:
        events = []
        for event in declutter(Sorting(world.robot), world.camera, Consolidation(most_cm2=2000.0), eyes=world.eyes):
            note(event)
            events.append(event)
    assert world.count().in_basket == 2
    assert sum(isinstance(event, Moved) and isinstance(event.action, Place) for event in events) >= 1
    with Image.open(tmp_path / "gathered.gif") as film:
        assert getattr(film, "n_frames", 1) > 5
        assert film.size[0] == 470

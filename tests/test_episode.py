"""What is recorded can be read, whatever ended the run, and done again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from pscover import InvalidResult, registry
from pscover.execution.declutter import Patience, declutter
from pscover.execution.episode import LOG, Header, Recorder, Replay, events, read_header, resumed
from pscover.execution.events import Captured, Decided, Ended, Event, Judged, Moved, Reason
from pscover.execution.ledger import Ledger
from pscover.execution.tabletop import ColourEyes, small_table
from pscover.policies.segment import Segment
from pscover.policy import Transport

pytest.importorskip("cv2")
EYES = ColourEyes()
HEADER = Header(policy="segment", options={"points": 5}, seed=3)


def recorded(folder: Path, name: str = "segment") -> list[Event]:
    table, seen = small_table(), []
    with Recorder(folder, HEADER) as record:
        for event in declutter(table, table, registry.policy(name), eyes=EYES, seed=3):
            record.write(event)
            seen.append(event)
    return seen


def same(one: Event, other: Event) -> bool:
    if isinstance(one, Captured) and isinstance(other, Captured):
        assert one.frame.depth is not None
        assert other.frame.depth is not None
        pictures = (one.frame.rgb == other.frame.rgb).all() and (one.frame.depth == other.frame.depth).all()
        return bool(pictures) and one.cloth == other.cloth
    if isinstance(one, Decided) and isinstance(other, Decided):
        if one.seen is not None and other.seen is not None:
            assert (one.seen.scene.labels == other.seen.scene.labels).all()
            assert one.seen.scene.names == other.seen.scene.names
            assert one.seen.grid == other.seen.grid
            assert one.seen.basket == other.seen.basket
        plain = [f.name for f in fields(Decided) if f.name not in ("plan", "seen")]
        return all(getattr(one, name) == getattr(other, name) for name in plain) and (one.seen is None) == (
            other.seen is None
        )
    return one == other


@pytest.mark.parametrize("name", ["segment", "consolidation", "height"])
def test_what_is_read_is_what_was_written(tmp_path: Path, name: str) -> None:
    written = recorded(tmp_path, name)
    read = list(events(tmp_path))
    assert len(read) == len(written)
    assert all(same(one, other) for one, other in zip(written, read, strict=True))
    assert read_header(tmp_path) == HEADER


@pytest.mark.parametrize("name", ["segment", "random", "hybrid-height"])
def test_a_replay_makes_the_same_run(tmp_path: Path, name: str) -> None:
    written = recorded(tmp_path, name)
    replay = Replay(tmp_path)
    again = list(declutter(replay, replay, registry.policy(name), eyes=EYES, seed=3))
    assert [type(event) for event in again] == [type(event) for event in written]
    moves = [[e.actions for e in run if isinstance(e, Decided)] for run in (written, again)]
    assert moves[0] == moves[1]


def test_a_replay_by_another_policy_says_so(tmp_path: Path) -> None:
    recorded(tmp_path)
    replay = Replay(tmp_path)
    with pytest.raises(InvalidResult, match="decides anew"):
        list(declutter(replay, replay, registry.policy("random"), eyes=EYES, seed=3))


def test_every_prefix_of_a_record_can_be_read(tmp_path: Path) -> None:
    written = recorded(tmp_path)
    content = (tmp_path / LOG).read_bytes()
    header = content.index(b"\n") + 1
    random = np.random.default_rng(0)
    for cut in [header, *random.integers(header, len(content), 10).tolist(), len(content)]:
        (tmp_path / LOG).write_bytes(content[:cut])
        read = list(events(tmp_path))
        assert len(read) == content[:cut].count(b"\n") - 1
        assert all(same(one, other) for one, other in zip(written, read, strict=False))


def test_a_killed_run_leaves_a_prefix_and_is_taken_up_again(tmp_path: Path) -> None:
    code = f"""
import os, signal
from pscover.execution.declutter import declutter
from pscover.execution.episode import Header, Recorder
from pscover.execution.events import Judged
from pscover.policies.segment import Segment
from pscover.execution.tabletop import ColourEyes, small_table
table = small_table()
record = Recorder({str(tmp_path)!r}, Header(policy="segment", options={{"points": 5}}, seed=3))
for event in declutter(table, table, Segment(), eyes=ColourEyes(), seed=3):
    record.write(event)
    if isinstance(event, Judged):
        os.kill(os.getpid(), signal.SIGKILL)
"""
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == -signal.SIGKILL
    with (tmp_path / LOG).open("ab") as file:
        file.write(b'{"event": "Mov')
    before = list(events(tmp_path))
    assert isinstance(before[-1], Judged)
    ledger = resumed(tmp_path, 2.0 * EYES.pixels_per_cm)
    assert ledger.transports == 1

    # The table as the killed run left it.
    table = small_table()
    first = before[1]
    assert isinstance(first, Decided)
    for event in first.actions[:1]:
        table.pick(event.pose)  # type: ignore[union-attr]
    table.transport()
    with Recorder(tmp_path, HEADER) as record:
        for later in declutter(table, table, Segment(), eyes=EYES, seed=3, ledger=ledger):
            record.write(later)
    whole = list(events(tmp_path))
    assert isinstance(whole[-1], Ended)
    assert whole[-1].reason is Reason.CLEAR
    assert resumed(tmp_path, 9.4).transports == 1 + sum(
        isinstance(event, Moved) and isinstance(event.action, Transport) for event in whole[len(before) :]
    )
    assert table.garments == []


def test_a_ledger_follows_from_a_record(tmp_path: Path) -> None:
    ledger = Ledger()
    for event in recorded(tmp_path):
        ledger = ledger.after(event, Patience().place_cm * EYES.pixels_per_cm)
    assert resumed(tmp_path, Patience().place_cm * EYES.pixels_per_cm) == ledger


def test_a_folder_of_another_run_is_not_written_to(tmp_path: Path) -> None:
    recorded(tmp_path)
    with pytest.raises(InvalidResult, match="use a new folder"):
        Recorder(tmp_path, Header(policy="random"))


def test_a_file_of_another_making_is_not_cut(tmp_path: Path) -> None:
    (tmp_path / LOG).write_text("my notes")
    with pytest.raises(InvalidResult, match="use a new folder"):
        Recorder(tmp_path, Header(policy="random"))
    assert (tmp_path / LOG).read_text() == "my notes"


def test_a_record_that_was_cut_in_its_first_line_begins_anew(tmp_path: Path) -> None:
    header = Header(policy="random", options={"baskets": ("white", "dark")})
    for kept in (None, 0, 30):
        if kept is not None:
            whole = (tmp_path / LOG).read_bytes()
            (tmp_path / LOG).write_bytes(whole[:kept])
        with Recorder(tmp_path, header):
            pass
        assert read_header(tmp_path).options == {"baskets": ["white", "dark"]}


@pytest.mark.parametrize(
    ("line", "match"),
    [
        ("[]", "expected a JSON object"),
        ('{"event": "Danced"}', "expected an event, got no 'Danced'"),
        ('{"event": "Moved", "action": {"action": "jump"}, "weight": null}', "an action 'jump'"),
        ('{"event": "Moved", "weight": null}', "got no 'action'"),
        ('{"event": "Ended", "reason": "bored", "message": ""}', "bored"),
        ('{"event": "Captured", "cloth": 1, "image": "../x.png", "depth": null}', "a file"),
        ('{"event": "Judged", "poses": [], "emptier": true, "changed": true, "cloth": 1e999}', "infinity"),
        ('{"event": "Moved", "action": {"action": "pick", "x": 1e999, "y": 1, "theta": 0}, "weight": 1}', "finite"),
        ('{"event": "Captured", "cloth": 1, "image": "gone.png", "depth": null}', "gone.png"),
        ('{"event": "Captured", "cloth": 1, "image": "..", "depth": null}', "expected an event"),
        ('{"event": "Captured", "cloth": 1, "image": 7, "depth": null}', "a file"),
        ('{"event": "Moved", "action": {"action": "pick", "x": "left", "y": 1, "theta": 0}, "weight": 1}', "left"),
    ],
)
def test_damaged_lines_are_named(tmp_path: Path, line: str, match: str) -> None:
    recorded(tmp_path)
    with (tmp_path / LOG).open("a") as file:
        file.write(line + "\n")
    with pytest.raises(InvalidResult, match=match):
        list(events(tmp_path))


def test_missing_and_foreign_records_are_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidResult, match="no such file"):
        read_header(tmp_path)
    (tmp_path / LOG).write_text(json.dumps({"schema": "pscover.plan/1"}) + "\n")
    with pytest.raises(InvalidResult, match="expected a record of schema"):
        list(events(tmp_path))
    assert os.listdir(tmp_path) == [LOG]  # noqa: PTH208

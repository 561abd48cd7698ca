"""What holds for every instance format."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pscover import Instance, InvalidInstance, Meta
from pscover.io import load_instance, save_instance, suffixes
from pscover.testing import instances

TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def described_instances(draw: st.DrawFn) -> Instance:
    """Instances with names, poses and numbers of all kinds."""
    plain = draw(instances())
    m, n = plain.elements, plain.candidates
    poses = np.array(draw(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=n, max_size=n))).reshape(n, 3)
    meta = Meta(
        name=draw(TEXTS),
        source=draw(TEXTS),
        elements=tuple(draw(st.one_of(st.just([]), st.lists(TEXTS, min_size=m, max_size=m)))),
        candidates=tuple(draw(st.one_of(st.just([]), st.lists(TEXTS, min_size=n, max_size=n)))),
        poses=poses if n and draw(st.booleans()) else None,
        optimum=draw(st.none() | NUMBERS),
    )
    required = np.array(draw(st.lists(st.floats(0, 1, exclude_max=True), min_size=m, max_size=m)))
    cost = np.array(draw(st.lists(st.floats(5e-324, 1e300), min_size=n, max_size=n)))
    return Instance.of(plain.probability, required, cost, plain.conflicts, meta)


def same_meta(one: Meta, other: Meta) -> bool:
    texts = [(m.name, m.source, m.elements, m.candidates, m.optimum) for m in (one, other)]
    if one.poses is None or other.poses is None:
        return texts[0] == texts[1] and one.poses is other.poses
    return texts[0] == texts[1] and one.poses.tobytes() == other.poses.tobytes()


@pytest.mark.parametrize("suffix", [".json", ".npz"])
@settings(deadline=None, max_examples=60)
@given(instance=described_instances())
def test_round_trip_gives_an_equal_instance_and_equal_bytes(suffix: str, instance: Instance) -> None:
    with tempfile.TemporaryDirectory() as folder:
        first, second = Path(folder, f"first{suffix}"), Path(folder, f"second{suffix}")
        save_instance(instance, first)
        loaded = load_instance(first)
        save_instance(loaded, second)
        assert loaded.digest == instance.digest
        assert same_meta(loaded.meta, instance.meta)
        assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_empty_instances_round_trip(suffix: str, tmp_path: Path) -> None:
    for shape in ((0, 0), (0, 3), (2, 0)):
        instance = Instance.of(np.zeros(shape))
        save_instance(instance, tmp_path / f"empty{suffix}")
        assert load_instance(tmp_path / f"empty{suffix}").digest == instance.digest


@pytest.mark.parametrize("suffix", suffixes())
def test_files_that_hold_nothing_useful(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"file{suffix}"
    with pytest.raises(InvalidInstance, match="there is no such file"):
        load_instance(path)
    for content in (b"", b"\n", b"\x00" * 100, b"\xff\xfe\x00", b"hello", b"PK\x03\x04", b"[" * 100_000, b'{"schema":'):
        path.write_bytes(content)
        with pytest.raises(InvalidInstance, match=f"file{suffix}"):
            load_instance(path)
    path.unlink()
    path.mkdir()
    with pytest.raises(InvalidInstance, match="got a directory"):
        load_instance(path)


def test_suffixes_are_checked_and_case_does_not_matter(tmp_path: Path) -> None:
    instance = Instance.of([[0.8]])
    with pytest.raises(InvalidInstance, match=r"ends in one of \.json, .*\.txt, got '\.yaml'"):
        save_instance(instance, tmp_path / "file.yaml")
    with pytest.raises(InvalidInstance, match="got ''"):
        load_instance(tmp_path / "file")
    save_instance(instance, tmp_path / "FILE.JSON")
    assert load_instance(tmp_path / "FILE.JSON").digest == instance.digest


@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_names_that_are_no_unicode_are_not_written(suffix: str, tmp_path: Path) -> None:
    instance = Instance.of([[0.8]], meta=Meta(name="\ud800"))
    with pytest.raises(InvalidInstance, match="text in Unicode"):
        save_instance(instance, tmp_path / f"file{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_running_out_of_memory_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def full(*_: object) -> None:
        raise MemoryError

    save_instance(Instance.of([[0.8]]), tmp_path / "file.json")
    monkeypatch.setattr("pscover.io.json.decode", full)
    with pytest.raises(InvalidInstance, match=r"file\.json: reading it takes more memory than there is"):
        load_instance(tmp_path / "file.json")

"""The archive reader: nothing is trusted that the archive says of itself, and nothing large is made before it is checked."""

from __future__ import annotations

import io
import pickle
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pscover import Instance, InvalidInstance, Meta
from pscover.io import load_instance, save_instance

SOUND = Instance.of(
    [[0.8, 0.5], [0.0, 1.0]], [0.7, 0.5], [1, 2.5], [(0, 1)], Meta(elements=("a", "b"), poses=np.arange(6.0).reshape(2, 3))
)


def arrays(tmp_path: Path) -> dict[str, Any]:
    save_instance(SOUND, tmp_path / "sound.npz")
    with np.load(tmp_path / "sound.npz", allow_pickle=False) as archive:
        return dict(archive)


def refusal(path: Path) -> str:
    with pytest.raises(InvalidInstance) as caught:
        load_instance(path)
    assert str(caught.value).startswith(f"{path}: ")
    return str(caught.value).removeprefix(f"{path}: ")


def packed(path: Path, members: dict[str, bytes], packing: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", packing) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def members(tmp_path: Path) -> dict[str, bytes]:
    save_instance(SOUND, tmp_path / "sound.npz")
    with zipfile.ZipFile(tmp_path / "sound.npz") as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def header(description: str) -> bytes:
    """The beginning of a .npy file that says of itself what it likes."""
    text = description.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


@pytest.mark.parametrize("write", [np.savez, np.savez_compressed])
def test_archives_that_numpy_wrote(write: Callable[..., None], tmp_path: Path) -> None:
    content = arrays(tmp_path)
    content["poses"] = np.asfortranarray(content["poses"])
    content["indices"] = content["indices"].astype(">i8")
    write(tmp_path / "other.npz", **content)
    loaded = load_instance(tmp_path / "other.npz")
    assert loaded.digest == SOUND.digest
    assert loaded.meta.poses is not None
    assert loaded.meta.poses.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert loaded.meta.elements == ("a", "b")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("data", [0.8, 0.5, 1.5], "probability: element 1, candidate 1: expected a number in (0, 1], got 1.5"),
        ("data", [0.8, np.nan, 1.0], "probability: element 0, candidate 1: expected a number in (0, 1], got nan"),
        ("data", [0.8, 0.5], "data: expected as many entries as indices has (3), got 2"),
        ("data", [1, 1, 1], "data: expected numbers of type <f8 or >f8 or <f4 or >f4, got '<i8'"),
        ("data", [[0.8, 0.5, 1.0]], "data: expected 1 dimension(s), got shape (1, 3)"),
        ("data", [1j, 1j, 1j], "data: expected numbers of type <f8 or >f8 or <f4 or >f4, got '<c16'"),
        ("data", 0.5, "data: expected 1 dimension(s), got shape ()"),
        ("indices", [0, 0, 2], "indices[2]: expected an element from 0 to 1, got 2"),
        ("indices", [0, -1, 1], "indices[1]: expected an element from 0 to 1, got -1"),
        ("indices", [0, 1, 1], "probability: element 1, candidate 1 is given twice; expected each pair once"),
        ("indptr", [0, 4, 3], "indptr: expected numbers that rise from 0 to 3, the length of indices"),
        ("indptr", [0, 1, 2**40], "indptr: expected numbers that rise from 0 to 3, the length of indices"),
        ("indptr", [0, 3], "indptr: expected one entry more than cost has (2), got 2"),
        ("required", [0.7, 1.0], "required[1]: expected a number in [0, 1), got 1.0"),
        ("cost", [1.0, np.inf], "cost[1]: expected a positive finite number, got inf"),
        ("conflict_members", [0, 2], "conflicts[0]: expected candidate indices below 2, got 2"),
        ("conflict_members", [0, 0], "conflicts[0]: candidate 0 is given twice"),
        ("conflict_starts", [0, 1], "conflicts: starts must run from 0 to the number of members"),
        ("conflict_starts", [0, 2**40, 2], "conflicts[1]: expected at least two candidate indices, got 0"),
        ("poses", [[0.0, 1.0, np.nan]] * 2, "poses: expected finite numbers of shape (2, 3), got (2, 3)"),
        ("poses", [[0.0, 1.0, 2.0]], "poses: expected finite numbers of shape (2, 3), got (1, 3)"),
    ],
)
def test_wrong_arrays(name: str, value: Any, message: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "wrong.npz", **{**arrays(tmp_path), name: np.array(value)})
    assert refusal(tmp_path / "wrong.npz") == message


def test_wrong_headers(tmp_path: Path) -> None:
    content = arrays(tmp_path)
    for text, message in (
        (b"{", "header: line 1, column 2: expected the rest of the document, got the end of the file"),
        (b'{"schema": "pscover.instance/7"}', "header: $.schema: expected 'pscover.instance/1', got \"pscover.instance/7\""),
        (b'{"schema": "pscover.instance/1", "elements": ["a"]}', "element names: expected 2, one each, got 1"),
        (
            b'{"schema": "pscover.instance/1", "name": "a", "name": "b"}',
            'header: expected each key of an object once, got "name" twice',
        ),
    ):
        np.savez(tmp_path / "wrong.npz", **{**content, "header": np.frombuffer(text, dtype=np.uint8)})
        assert refusal(tmp_path / "wrong.npz") == message


def test_missing_and_unknown_arrays(tmp_path: Path) -> None:
    content = arrays(tmp_path)
    np.savez(tmp_path / "wrong.npz", **content, more=np.zeros(1))
    assert refusal(tmp_path / "wrong.npz").endswith("once each, got 'more.npy'")
    del content["cost"]
    np.savez(tmp_path / "wrong.npz", **content)
    assert refusal(tmp_path / "wrong.npz").startswith("expected an array 'cost', got only ")


def test_an_array_given_twice(tmp_path: Path) -> None:
    with (
        zipfile.ZipFile(packed(tmp_path / "wrong.npz", members(tmp_path)), "a") as archive,
        pytest.warns(UserWarning, match="Duplicate"),
    ):
        archive.writestr("cost.npy", b"")
    assert refusal(tmp_path / "wrong.npz").endswith("once each, got 'cost.npy'")


def test_pickles_are_never_loaded(tmp_path: Path) -> None:
    np.savez(tmp_path / "wrong.npz", **{**arrays(tmp_path), "cost": np.array([Fired()], dtype=object)})
    assert refusal(tmp_path / "wrong.npz").endswith("got '|O'")
    (tmp_path / "pickle.npz").write_bytes(pickle.dumps(Fired()))
    assert refusal(tmp_path / "pickle.npz").startswith("expected a NumPy archive")


class Fired:
    """Fails the test when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return pytest.fail, ("a pickle was loaded",)


@pytest.mark.parametrize(
    "description",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 1000000000), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "9" * 60 + ",), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "9" * 6000 + ",), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-2,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (2,), 'more': 1}",
        "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (2,), }",
        "[" * 9000,
        "__import__('os').abort()",
        "",
    ],
)
def test_arrays_that_declare_what_they_do_not_hold(description: str, tmp_path: Path) -> None:
    content = members(tmp_path)
    content["cost.npy"] = header(description) + np.ones(2).tobytes()
    assert refusal(packed(tmp_path / "wrong.npz", content)).startswith("cost: expected ")


def test_header_lengths_beyond_the_file(tmp_path: Path) -> None:
    content = members(tmp_path)
    for start in (
        b"\x93NUMPY\x02\x00\xff\xff\xff\xff",
        b"\x93NUMPY\x01\x00\xff\xff",
        b"\x93NUMPY\x09\x00\x01\x00 ",
        b"\x93NUM",
    ):
        content["cost.npy"] = start
        assert refusal(packed(tmp_path / "wrong.npz", content)).startswith("cost: expected ")


def test_a_zip_bomb_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    content = members(tmp_path)
    content["cost.npy"] = header("{'descr': '<f8', 'fortran_order': False, 'shape': (12500000,), }") + bytes(100_000_000)
    packed(tmp_path / "bomb.npz", content, zipfile.ZIP_DEFLATED)
    length = (tmp_path / "bomb.npz").stat().st_size
    del content
    tracemalloc.start()
    try:
        message = refusal(tmp_path / "bomb.npz")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert message.startswith(f"expected an archive of {length} bytes to unpack to at most 67108864 bytes, got 1000")
    assert peak < 5_000_000


def test_other_packings_and_damage(tmp_path: Path) -> None:
    content = members(tmp_path)
    packed(tmp_path / "bz2.npz", content, zipfile.ZIP_BZIP2)
    assert refusal(tmp_path / "bz2.npz") == "header: expected a stored or deflated array, got another packing"
    whole = packed(tmp_path / "whole.npz", content).read_bytes()
    for length in range(0, len(whole), 97):
        (tmp_path / "cut.npz").write_bytes(whole[:length])
        assert refusal(tmp_path / "cut.npz").startswith("expected a NumPy archive (.npz), got a damaged file: ")
    at = whole.index(np.array([0.8, 0.5, 1.0]).tobytes())
    (tmp_path / "flipped.npz").write_bytes(whole[:at] + b"\x00" + whole[at + 1 :])
    assert "CRC" in refusal(tmp_path / "flipped.npz")


def test_numpy_reads_what_was_written(tmp_path: Path) -> None:
    content = arrays(tmp_path)
    assert content["data"].tolist() == [0.8, 0.5, 1.0]
    assert bytes(content["header"]).startswith(b'{"schema":"pscover.instance/1"')
    with zipfile.ZipFile(io.BytesIO((tmp_path / "sound.npz").read_bytes())) as archive:
        assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}

"""Files are written whole or not at all, and nothing but a regular file is read."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from pscover.errors import InvalidInstance, PscoverError
from pscover.files import read_bytes, write_bytes


def test_a_file_is_replaced_and_nothing_else_is_left(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    write_bytes(path, b"old and long")
    write_bytes(path, b"new")
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_new_file_has_ordinary_permissions_and_an_old_one_keeps_its_own(tmp_path: Path) -> None:
    ordinary, path = tmp_path / "ordinary", tmp_path / "plan.json"
    ordinary.write_bytes(b"")
    write_bytes(path, b"1")
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE(ordinary.stat().st_mode)
    path.chmod(0o640)
    write_bytes(path, b"2")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "real").write_bytes(b"old")
    (tmp_path / "link").symlink_to("real")
    write_bytes(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new"


def test_when_writing_fails_the_old_content_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "plan.json"
    path.write_bytes(b"old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(PscoverError, match=r"plan\.json: cannot be written: No space left on device"):
        write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_interrupt_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(descriptor: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_bytes(tmp_path / "plan.json", b"new")
    assert list(tmp_path.iterdir()) == []


def test_places_where_no_file_can_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    for path, words in (
        (tmp_path, "it is a directory"),
        (tmp_path / "absent" / "plan.json", "there is no folder .*absent; create it first"),
        (tmp_path / "file" / "plan.json", "is not a folder"),
        (tmp_path / ("x" * 300), "cannot be written"),
        (Path("nul\0byte"), "cannot be written"),
    ):
        with pytest.raises(PscoverError, match=words):
            write_bytes(path, b"new")


def test_no_permission_to_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "plan.json"
    path.write_bytes(b"old")
    path.chmod(0o444)
    # Root may write everything, so the answer of the system is given here.
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(PscoverError, match="no permission for the file or its folder"):
        write_bytes(path, b"new")
    assert path.read_bytes() == b"old"


def test_only_regular_files_of_limited_size_are_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"12345")
    os.mkfifo(tmp_path / "pipe")
    for path, words in (
        (tmp_path, "expected a file, got a directory"),
        (tmp_path / "pipe", "got a pipe, socket or device"),
        (Path("/dev/zero"), "got a pipe, socket or device"),
        (tmp_path / "absent", "there is no such file"),
        (tmp_path / "file" / "x", "cannot be opened: Not a directory"),
        (tmp_path / "file", "expected at most 4 bytes, got 5"),
        (Path("nul\0byte"), "cannot be opened"),
    ):
        with pytest.raises(InvalidInstance, match=words):
            read_bytes(path, 4, InvalidInstance)
    assert read_bytes(tmp_path / "file", 5, InvalidInstance) == b"12345"


def test_no_permission_to_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_bytes(b"12345")

    def denied(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", denied)
    with pytest.raises(InvalidInstance, match="no permission to read it"):
        read_bytes(tmp_path / "file", 5, InvalidInstance)

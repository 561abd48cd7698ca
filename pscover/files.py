"""Reading files that may be anything, and writing files that are whole or not there at all."""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from pscover.errors import PscoverError

BYTE_LIMIT = 2**31
"""No file above 2 GiB is opened."""

TEXT_LIMIT = 2**28
"""Text formats take up to 256 MiB: parsed, they need some twenty times their length in memory."""


@contextmanager
def opened(path: Path, limit: int, error: type[PscoverError]) -> Iterator[BinaryIO]:
    """An untrusted file, open for reading: a regular file of at most `limit` bytes.

    Parameters
    ----------
    path
        Of the file.
    limit
        The most bytes it may have.
    error
        What to raise.

    Raises
    ------
    PscoverError
        Of the type `error`, if the file is missing, too large, a directory, a pipe or a device, or may not be read.
    """
    try:
        status = path.stat()
        # A pipe or a device may block for ever, and its length is unknown.
        if stat.S_ISDIR(status.st_mode):
            raise error(f"{path}: expected a file, got a directory")
        if not stat.S_ISREG(status.st_mode):
            raise error(f"{path}: expected a regular file, got a pipe, socket or device")
        if status.st_size > limit:
            raise error(f"{path}: expected at most {limit} bytes, got {status.st_size}")
        file = path.open("rb")
    except FileNotFoundError:
        raise error(f"{path}: expected a file, got nothing: there is no such file") from None
    except PermissionError:
        raise error(f"{path}: expected a readable file, got no permission to read it") from None
    except (OSError, ValueError) as problem:
        raise error(f"{path}: cannot be opened: {_words(problem)}") from None
    with file:
        yield file


def read_bytes(path: Path, limit: int, error: type[PscoverError]) -> bytes:
    """The whole content of an untrusted file; the same parameters and errors as `opened`."""
    with opened(path, limit, error) as file:
        try:
            # A file may grow after its size was looked at.
            content = file.read(limit + 1)
        except OSError as problem:
            raise error(f"{path}: cannot be read: {_words(problem)}") from None
    if len(content) > limit:
        raise error(f"{path}: expected at most {limit} bytes, got more")
    return content


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file so that, whatever happens, `path` holds either its old content or all of the new.

    The content goes to a temporary file in the same folder, is flushed to the disk, and then takes the name in one step.
    A new file gets the permissions that the process gives to new files; an existing one keeps its own. A symbolic link is
    followed.

    Parameters
    ----------
    path
        Where to write.
    content
        What to write.

    Raises
    ------
    PscoverError
        If the folder does not exist, the path is a directory or is write-protected, or the disk is full.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_bytes(Path(folder, "plan.txt"), b"0 2")
    ...     print(Path(folder, "plan.txt").read_text(), [file.name for file in Path(folder).iterdir()])
    0 2 ['plan.txt']
    """
    try:
        target = Path(os.path.realpath(path))
        mode = _mode_to_keep(target)
        temporary = target.parent / f".pscover-{secrets.token_hex(8)}.tmp"
        try:
            _write_new(temporary, content, mode)
            temporary.replace(target)
        finally:
            with suppress(FileNotFoundError):
                temporary.unlink()
        _flush_folder(target.parent)
    except FileNotFoundError:
        raise PscoverError(f"{path}: cannot be written: there is no folder {Path(path).parent}; create it first") from None
    except NotADirectoryError:
        raise PscoverError(f"{path}: cannot be written: {Path(path).parent} is not a folder") from None
    except PermissionError:
        raise PscoverError(f"{path}: cannot be written: no permission for the file or its folder") from None
    except (OSError, ValueError) as problem:
        raise PscoverError(f"{path}: cannot be written: {_words(problem)}") from None


def _mode_to_keep(target: Path) -> int | None:
    """The permissions of the file that is to be replaced, or None if there is none."""
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(None, "it is a directory")
    if not stat.S_ISREG(mode):
        raise OSError(None, "it is a pipe, socket or device")
    if not os.access(target, os.W_OK):
        # Renaming over a file asks only for permission on the folder: a write-protected file would be lost.
        raise PermissionError
    return stat.S_IMODE(mode)


def _write_new(path: Path, content: bytes, mode: int | None) -> None:
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    with os.fdopen(os.open(path, flags, 0o666), "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    if mode is not None:
        path.chmod(mode)


def _flush_folder(folder: Path) -> None:
    """Make the new name survive a power cut, where the system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _words(problem: Exception) -> str:
    return str(getattr(problem, "strerror", None) or problem)

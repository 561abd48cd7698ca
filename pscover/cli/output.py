"""Where output goes: consoles, the one JSON document, and files that are known to be writable before the work starts."""

from __future__ import annotations

import io
import json
import math
import os
import re
import sys
import tempfile
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import say
from pscover.errors import PscoverError

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

SPACES_AT_END = re.compile(r" +$", re.MULTILINE)


def make_printable() -> None:
    """Let what a stream lacks not end the program: characters of its encoding, or, where the shell closed it, the stream."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # It takes the number of the closed one, which would else be that of the next file opened.
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115, PTH123 - open as long as the process
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def screen() -> Console:
    """Standard output, for tables."""
    from rich.console import Console

    # Names come from files: brackets and colons in them are not markup.
    return Console(markup=False, emoji=False, highlight=False)


def aside() -> Console:
    """Standard error, for the live line."""
    from rich.console import Console

    return Console(stderr=True, markup=False, emoji=False, highlight=False)


def show(*parts: RenderableType) -> None:
    """Print tables and lines on standard output, without spaces at the ends of lines."""
    console = screen()
    with console.capture() as captured:
        for part in parts:
            console.print(part)
    sys.stdout.write(SPACES_AT_END.sub("", captured.get()))


def show_document(document: Mapping[str, Any]) -> None:
    """Print the one JSON document of a command."""
    click.echo(json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False))


def plain(value: Any) -> Any:
    """The value in types that JSON has; what is not finite becomes None.

    Examples
    --------
    >>> plain({"bound": -math.inf, "chosen": (1, 2)})
    {'bound': None, 'chosen': [1, 2]}
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, Iterable):
        return [plain(item) for item in value]
    return str(value)


def require_writable(path: Path | None, inputs: Iterable[Path] = (), suffixes: tuple[str, ...] = ()) -> None:
    """Raise unless a file can be written at `path`, so that no long work is done for nothing.

    Parameters
    ----------
    path
        Of the output; None is no output.
    inputs
        Files that the output must not replace.
    suffixes
        The endings that the output may have; any if empty.

    Raises
    ------
    PscoverError
        With what is in the way.
    """
    if path is None:
        return
    if str(path) == "-":
        raise PscoverError("-: expected a file to write; for standard output use --json")
    if suffixes and path.suffix.lower() not in suffixes:
        raise PscoverError(f"{path}: expected a file name that ends in {' or '.join(suffixes)}, got {path.suffix!r}")
    if path.is_dir():
        raise PscoverError(f"{path}: expected a file to write, got a directory; name a file in it")
    if path.exists() and not path.is_file():
        raise PscoverError(f"{path}: expected a file to write, got a pipe, socket or device")
    if any(path.exists() and other.exists() and path.samefile(other) for other in inputs):
        raise PscoverError(f"{path}: would replace an input of this command; name another file")
    if path.exists() and not os.access(path, os.W_OK):
        raise PscoverError(f"{path}: cannot be written: no permission; name another place for it")
    folder = Path(os.path.realpath(path)).parent
    try:
        # Permissions alone do not tell: the file system may be read-only, or full.
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileNotFoundError:
        raise PscoverError(f"{path}: cannot be written: there is no folder {path.parent}; create it first") from None
    except OSError as problem:
        raise PscoverError(f"{path}: cannot be written: {problem.strerror}; name another place for it") from None


def require_distinct(*paths: Path | None) -> None:
    """Raise if two outputs of one command have the same name."""
    given = [os.path.realpath(path) for path in paths if path is not None]
    if len(set(given)) < len(given):
        twice = next(path for path in given if given.count(path) > 1)
        raise PscoverError(f"{twice}: is named for two outputs of this command; name two files")


def wrote(path: Path, what: str) -> None:
    """Say on standard error where something went."""
    say(f"wrote {what} to {path}")


def wrote_into(folder: Path, paths: Iterable[Path]) -> None:
    """Say on standard error which files went into a folder."""
    say(f"wrote {', '.join(path.name for path in paths)} into {folder}")

"""One piece of work for every photo of a folder: a bar on standard error, and failures that do not stop the rest."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from pscover.cli.fail import Exit, explained, say
from pscover.cli.look import sibling
from pscover.cli.words import count
from pscover.errors import MissingDependency, PscoverError, UnknownName

IMAGES = (".jpg", ".jpeg", ".png")
MADE_HERE = (".plan.png", ".segments.png")
"""Endings of pictures that pscover draws itself."""
OF_PHOTOS = (".labels.png", ".depth.png", "_depth.png")
"""Endings of images that belong to a photo beside them."""
Done = TypeVar("Done")


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A file for which the work could not be done."""

    path: Path
    code: Exit
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome(Generic[Done]):
    """What became of a folder."""

    done: list[tuple[Path, Done]]
    failures: list[Failure]
    interrupted: bool

    def code(self, worst: Exit) -> Exit:
        """The exit code, `worst` being that of the work that was done."""
        if any(failure.code is Exit.BUG for failure in self.failures):
            return Exit.BUG
        if self.interrupted:
            return Exit.INTERRUPTED
        return Exit.BAD_INPUT if self.failures else worst

    def report(self) -> None:
        """Say on standard error what went wrong, the same words once, and whether Ctrl-C ended it."""
        for message, times in Counter(failure.message for failure in self.failures).items():
            first = next(failure.path for failure in self.failures if failure.message == message)
            said = message if str(first) in message or times > 1 else f"{first}: {message}"
            say(f"error: {said}" if times == 1 else f"error: {times} files: {said}")
        if self.interrupted:
            say(f"interrupted after {count(len(self.done) + len(self.failures), 'photo')}; the rest was not looked at")


def photos_in(folder: Path) -> list[Path]:
    """The images of a folder, sorted by name, without labels, depth and pictures of a photo beside them.

    Raises
    ------
    PscoverError
        If there are none.
    """
    found = [
        path
        for path in sorted(folder.iterdir())
        if path.suffix.lower() in IMAGES
        and not path.name.startswith(".")
        and not path.name.lower().endswith(MADE_HERE)
        and not any(sibling(path, ending) for ending in OF_PHOTOS)
        and not path.is_dir()
    ]
    if not found:
        raise PscoverError(f"{folder}: expected a folder with photos (.jpg, .jpeg, .png), got none in this directory")
    return found


def output_folder(given: Path | None, source: Path) -> Path:
    """Where the outputs of a folder go; it is made if its parent is there.

    Raises
    ------
    PscoverError
        If none is given, or it cannot be made or written.
    """
    from pscover.cli.output import require_writable

    if given is None:
        raise PscoverError(f"{source}: is a directory; say with -o into which folder the outputs go")
    if given.exists() and not given.is_dir():
        raise PscoverError(f"{given}: expected a folder for the outputs, got a file")
    if given.exists() and given.samefile(source):
        raise PscoverError(f"{given}: expected another folder for the outputs than that of the photos")
    try:
        given.mkdir(exist_ok=True)
    except FileNotFoundError:
        raise PscoverError(f"{given}: cannot be made: there is no folder {given.parent}; create it first") from None
    except OSError as problem:
        raise PscoverError(f"{given}: cannot be made: {problem.strerror}; name another place for it") from None
    require_writable(given / "pscover")
    return given


def stems(paths: Sequence[Path]) -> dict[Path, str]:
    """What the outputs of each are named after: its name without ending where that is unique, else the whole name."""
    shared = Counter(path.stem for path in paths)
    return {path: path.stem if shared[path.stem] == 1 else path.name for path in paths}


def each(paths: Sequence[Path], work: Callable[[Path], Done], *, verb: str, quiet: bool) -> Outcome[Done]:
    """Do the work for every file; Ctrl-C ends it with what is done.

    What would fail alike for all (a package that is missing, a name that nobody knows) is raised.
    """
    done: list[tuple[Path, Done]] = []
    failures: list[Failure] = []
    try:
        with _bar(len(paths), quiet=quiet) as step:
            for path in paths:
                step(f"{verb} {path.name}", 0)
                try:
                    done.append((path, work(path)))
                except (MissingDependency, UnknownName):
                    raise
                except Exception as error:
                    code, message = explained(error)
                    failures.append(Failure(path=path, code=code, message=message))
                step("", 1)
    except KeyboardInterrupt:
        return Outcome(done=done, failures=failures, interrupted=True)
    return Outcome(done=done, failures=failures, interrupted=False)


@contextmanager
def _bar(total: int, *, quiet: bool) -> Iterator[Callable[[str, int], None]]:
    """A bar, unless standard error is no terminal or it is to be quiet; yields what moves it."""
    if quiet or not sys.stderr.isatty():
        yield lambda label, by: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from pscover.cli.output import aside

    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=aside(), transient=True) as progress:
        task = progress.add_task("", total=total)

        def step(label: str, by: int) -> None:
            progress.update(task, advance=by, description=label)

        yield step

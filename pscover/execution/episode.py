"""A record of a run: one JSON line an event and the images beside them; whatever ends the run, what was written can be read.

Images are written whole before the line that names them, and lines are flushed one by one. A last line that was cut off
is left out when the record is read, and cut away when it is taken up again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO

from pscover.errors import InvalidResult, PscoverError
from pscover.execution.episode_lines import decoded, encoded, is_image
from pscover.execution.events import Captured, Event, FrameLost, MotionFailed, Moved
from pscover.execution.ledger import Ledger
from pscover.files import read_bytes
from pscover.policy import Action, Pick, Place, Transport
from pscover.robot import Frame, Pose, RobotFailed

LOG = "episode.jsonl"
SCHEMA = "pscover.execution.episode/1"
BYTE_LIMIT = 2**30


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """What a run began with.

    Parameters
    ----------
    policy
        Its name.
    options
        Its settings, as JSON.
    seed
        Of everything random.
    pixels_per_cm
        Scale of the frames.
    """

    policy: str
    options: dict[str, Any] = field(default_factory=dict)
    seed: int = 0
    pixels_per_cm: float = 4.7


class Recorder:
    """Writes a record, event by event.

    Parameters
    ----------
    folder
        Where to. It is made; if a record lies in it already, it goes on after the last whole line.
    header
        For a new record.

    Raises
    ------
    PscoverError
        If nothing can be written there.
    InvalidResult
        If what lies there is no record, or one of another run.

    Examples
    --------
    >>> import tempfile
    >>> from pscover.execution.events import Ended, Reason
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with Recorder(folder, Header(policy="random")) as record:
    ...         record.write(Ended(reason=Reason.CLEAR))
    ...     [str(event.reason) for event in events(folder)]
    ['clear']
    """

    def __init__(self, folder: str | PathLike[str], header: Header) -> None:
        self.folder = Path(folder)
        self.header = header
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._file, self._number = self._opened()
        except OSError as problem:
            raise PscoverError(f"{folder}: cannot be written: {problem.strerror}") from None

    def _opened(self) -> tuple[BinaryIO, int]:
        path = self.folder / LOG
        first = _line({"schema": SCHEMA, **_header_document(self.header)})
        content = read_bytes(path, BYTE_LIMIT, InvalidResult) if path.exists() else b""
        lines, length = _whole_lines(content)
        is_same = lines[0] + b"\n" == first if lines else first.startswith(content)
        if not is_same:
            raise InvalidResult(f"{path}: expected the record of the same run, got that of another; use a new folder")
        file = path.open("r+b" if path.exists() else "x+b")
        file.truncate(length)
        file.seek(length)
        if not lines:
            _append(file, first)
        return file, max(0, len(lines) - 1)

    def write(self, event: Event) -> None:
        """Add an event.

        Raises
        ------
        PscoverError
            If the disk is full.
        """
        try:
            _append(self._file, _line(encoded(event, self.folder, self._number)))
        except OSError as problem:
            raise PscoverError(f"{self.folder}: cannot be written: {problem.strerror}") from None
        self._number += 1

    def close(self) -> None:
        """Write no more."""
        self._file.close()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()


def _line(document: dict[str, Any]) -> bytes:
    return json.dumps(document, allow_nan=False).encode() + b"\n"


def _append(file: BinaryIO, line: bytes) -> None:
    file.write(line)
    file.flush()
    os.fsync(file.fileno())


def _header_document(header: Header) -> dict[str, Any]:
    return {
        "policy": header.policy,
        "options": header.options,
        "seed": header.seed,
        "pixels_per_cm": header.pixels_per_cm,
    }


def _whole_lines(content: bytes) -> tuple[list[bytes], int]:
    """The lines that were written to their end, and the bytes that they fill."""
    length = content.rfind(b"\n") + 1
    return content[:length].splitlines(), length


def _documents(folder: str | PathLike[str]) -> Iterator[tuple[int, dict[str, Any]]]:
    path = Path(folder) / LOG
    for number, line in enumerate(_whole_lines(read_bytes(path, BYTE_LIMIT, InvalidResult))[0], start=1):
        try:
            document = json.loads(line)
        except (ValueError, RecursionError):
            document = None
        if not isinstance(document, dict):
            raise InvalidResult(f"{path}, line {number}: expected a JSON object, got {line[:40]!r}")
        yield number, document


def read_header(folder: str | PathLike[str]) -> Header:
    """What the recorded run began with.

    Raises
    ------
    InvalidResult
        If there is no record.
    """
    path = Path(folder) / LOG
    _, first = next(_documents(folder), (0, {}))
    if first.get("schema") != SCHEMA:
        raise InvalidResult(f"{path}: expected a record of schema {SCHEMA!r}, got {first.get('schema')!r}")
    import msgspec

    try:
        return msgspec.convert({key: value for key, value in first.items() if key != "schema"}, type=Header)
    except (msgspec.ValidationError, UnicodeError) as problem:
        raise InvalidResult(f"{path}, line 1: {problem}") from None


def events(folder: str | PathLike[str]) -> Iterator[Event]:
    """The recorded events in order, images included; plans are not kept, but what was seen is.

    Raises
    ------
    InvalidResult
        If there is no record, or a line or image in it is damaged.
    """
    read_header(folder)
    for number, document in _documents(folder):
        if number > 1:
            yield decoded(document, Path(folder), f"{Path(folder) / LOG}, line {number}")


def resumed(folder: str | PathLike[str], same_place: float) -> Ledger:
    """The ledger of a recorded run, with which `declutter` goes on where it ended.

    Parameters
    ----------
    folder
        Of the record.
    same_place
        In pixels: `Patience.place_cm` times the scale.
    """
    ledger = Ledger()
    for event in events(folder):
        ledger = ledger.after(event, same_place)
    return ledger


def discard(folder: str | PathLike[str]) -> None:
    """Delete a record, so that another can be made in its place; a folder that is missing or empty is left alone.

    Only files with the names that a record gives are deleted: whatever else lies there stays.

    Raises
    ------
    InvalidResult
        If there is something else than a record in the folder: then nothing is deleted.
    PscoverError
        If the files cannot be deleted.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     Recorder(folder, Header(policy="random")).close()
    ...     _ = Path(folder, "notes.txt").write_text("mine")
    ...     discard(folder)
    ...     [path.name for path in Path(folder).iterdir()]
    ['notes.txt']
    """
    place = Path(folder)
    try:
        names = sorted(path.name for path in place.iterdir())
    except FileNotFoundError:
        return
    except OSError as problem:
        raise PscoverError(f"{folder}: cannot be read: {problem.strerror}") from None
    if not names:
        return
    if LOG not in names:
        raise InvalidResult(f"{folder}: expected a record ({LOG}) or an empty folder, got {names[0]!r}; use a new folder")
    if next(_documents(place), None) is not None:
        # A run may have ended before its first line was whole.
        read_header(place)
    try:
        for name in names:
            if name != LOG and is_image(name):
                (place / name).unlink()
        # Last, for it tells that the images are the record's.
        (place / LOG).unlink()
    except OSError as problem:
        raise PscoverError(f"{folder}: cannot be deleted: {problem.strerror}") from None


class Replay:
    """The robot and the camera of a recorded run: they give what was recorded, and check that the same motions are
    asked for.

    Parameters
    ----------
    folder
        Of the record.

    Examples
    --------
    The same policy with the same seed does the same again:

    >>> import tempfile
    >>> from pscover.execution.declutter import declutter
    >>> from pscover.policies.segment import Segment
    >>> from pscover.execution.tabletop import ColourEyes, small_table
    >>> table, eyes = small_table(), ColourEyes()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with Recorder(folder, Header(policy="segment")) as record:
    ...         for event in declutter(table, table, Segment(), eyes=eyes):
    ...             record.write(event)
    ...     again = Replay(folder)
    ...     print(str(list(declutter(again, again, Segment(), eyes=eyes))[-1].reason))
    clear
    """

    def __init__(self, folder: str | PathLike[str]) -> None:
        self.folder = Path(folder)
        self._left = events(folder)
        self._weight: float | None = None

    def capture(self) -> Frame:
        """The next recorded frame.

        Raises
        ------
        RobotFailed
            Where it was lost, and at the end of the record.
        """
        event = self._next(Captured | FrameLost)
        if isinstance(event, Captured):
            return event.frame
        raise RobotFailed(event.message if isinstance(event, FrameLost) else "the record has ended")

    def pick(self, pose: Pose) -> None:
        """As recorded."""
        self._move(Pick(pose=pose))

    def place(self, point: tuple[float, float]) -> None:
        """As recorded."""
        self._move(Place(x=point[0], y=point[1]))

    def transport(self) -> None:
        """As recorded."""
        self._move(Transport())

    def transport_to(self, basket: str) -> None:
        """As recorded."""
        self._move(Transport(basket=basket))

    def weight(self) -> float | None:
        """That of the last pick."""
        return self._weight

    def _move(self, action: Action) -> None:
        event = self._next(Moved | MotionFailed)
        if event is None:
            raise RobotFailed("the record has ended")
        assert isinstance(event, Moved | MotionFailed)
        if event.action != action:
            raise InvalidResult(
                f"{self.folder}: expected {event.action}, as recorded, got {action}: the policy decides anew"
            )
        if isinstance(event, MotionFailed):
            raise RobotFailed(event.message)
        self._weight = event.weight

    def _next(self, kinds: Any) -> Event | None:
        return next((event for event in self._left if isinstance(event, kinds)), None)

"""A sweep: one function over many cases, kept on disk case by case, so that it can be killed and taken up again.

A folder holds one sweep:

- `sweep.json`: its name and settings; a folder of another sweep is refused.
- `results.jsonl`: a line a case, `{"case": ..., "row": ...}`. Nothing in it depends on the speed of the computer: once all
  cases have been run the lines are sorted, and two runs of a sweep end with the same bytes wherever they ran.
- `timings.jsonl`: a line a case, `{"case": ..., "timing": ..., "machine": ...}`: what does depend on it.
- `machines.jsonl`: a line a machine, `{"machine": ..., ...}`, for the names in the timings.

Lines are appended whole and flushed; what a kill left of a line is cut off when the sweep goes on.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

from pscover.errors import InvalidResult, InvalidSettings, PscoverError
from pscover.evidence.executors import Executors, run_each
from pscover.evidence.machine import Machine, this_machine
from pscover.files import TEXT_LIMIT, read_bytes, write_bytes

C = TypeVar("C")
R = TypeVar("R")
T = TypeVar("T")
SCHEMA = "pscover.sweep/1"
SETTINGS, RESULTS, TIMINGS, MACHINES = "sweep.json", "results.jsonl", "timings.jsonl", "machines.jsonl"
FILES = frozenset((SETTINGS, RESULTS, TIMINGS, MACHINES))


@dataclass(frozen=True, slots=True, kw_only=True)
class Done(Generic[R, T]):
    """What came of a case.

    Parameters
    ----------
    row
        What follows from the case alone: equal on every machine.
    timing
        What depends on the speed of the computer.
    """

    row: R
    timing: T


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep(Generic[C, R, T]):
    """A function and the types that it maps: frozen dataclasses of what JSON can hold (None for numbers that do not exist).

    Parameters
    ----------
    name
        Of the sweep.
    run
        From a case to what comes of it. A function of a module, so that other processes find it; everything random in it
        follows from the case.
    case, row, timing
        The types.
    settings
        What all cases have in common and what decides about rows (limits, tolerances); JSON. Runs with others need another
        folder.
    """

    name: str
    run: Callable[[C], Done[R, T]]
    case: type[C]
    row: type[R]
    timing: type[T]
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Measured(Generic[C, R, T]):
    """Runs a case where the worker is, and notes where that is."""

    run: Callable[[C], Done[R, T]]

    def __call__(self, case: C) -> tuple[Done[R, T], Machine]:
        return self.run(case), this_machine()


class Store(Generic[C, R, T]):
    """The results of a sweep in a folder.

    Parameters
    ----------
    folder
        Of the sweep; made if it is not there.
    sweep
        What is kept there.

    Raises
    ------
    InvalidSettings
        If the folder holds another sweep, the same with other settings, or files that are no sweep's.
    InvalidResult
        If a file in it is damaged.
    PscoverError
        If it cannot be written.
    """

    def __init__(self, folder: str | PathLike[str], sweep: Sweep[C, R, T]) -> None:
        self.folder = Path(folder)
        self.sweep = sweep
        _claim(self.folder, sweep)
        self._rows: dict[C, R] = {}
        self._timings: dict[C, tuple[T, str]] = {}
        self._machines: dict[str, Machine] = {}
        for name in (RESULTS, TIMINGS, MACHINES):
            _cut_off(self.folder / name)
        for line, where in self._lines(MACHINES):
            self._machines[line["machine"]] = self._as({k: v for k, v in line.items() if k != "machine"}, Machine, where)
        for line, where in self._lines(TIMINGS):
            case = self._as(line.get("case"), sweep.case, where)
            self._timings[case] = self._as(line.get("timing"), sweep.timing, where), str(line.get("machine"))
        for line, where in self._lines(RESULTS):
            self._rows[self._as(line.get("case"), sweep.case, where)] = self._as(line.get("row"), sweep.row, where)

    def row(self, case: C) -> R | None:
        """What came of a case; None if it has not been run to its end."""
        return self._rows.get(case)

    def timing(self, case: C) -> T | None:
        """How long it took; None if it has not been run to its end."""
        return self._timings[case][0] if case in self._rows else None

    def machine(self, case: C) -> Machine | None:
        """Where it ran; None if it has not been run to its end."""
        return self._machines.get(self._timings[case][1]) if case in self._rows else None

    @property
    def cases(self) -> tuple[C, ...]:
        """All that have been run to their end."""
        return tuple(self._rows)

    @property
    def machines(self) -> tuple[Machine, ...]:
        """All on which some case ran."""
        return tuple(self._machines.values())

    def save(self, case: C, done: Done[R, T], machine: Machine) -> None:
        """Keep what came of a case; its row last, for that marks it as done.

        Raises
        ------
        InvalidResult
            If it is not the same after JSON: a NaN, an infinity, a list where the type says tuple.
        """
        for value, type_ in ((case, self.sweep.case), (done.row, self.sweep.row), (done.timing, self.sweep.timing)):
            _check(value, type_)
        name = hashlib.sha256(msgspec.json.encode(machine)).hexdigest()[:8]
        if name not in self._machines:
            self._append(MACHINES, {"machine": name, **msgspec.to_builtins(machine)})
        self._append(TIMINGS, {"case": case, "timing": done.timing, "machine": name})
        self._append(RESULTS, {"case": case, "row": done.row})
        self._machines[name] = machine
        self._timings[case] = done.timing, name
        self._rows[case] = done.row

    def sort(self, cases: Sequence[C]) -> None:
        """Bring the files into the order of the cases, those that are not among them last."""
        place = {case: k for k, case in enumerate(cases)}
        ordered = sorted(self._rows, key=lambda case: (place.get(case, len(place)), msgspec.json.encode(case)))
        timed = ({"case": case, "timing": self._timings[case][0], "machine": self._timings[case][1]} for case in ordered)
        write_bytes(self.folder / TIMINGS, b"".join(map(_line, timed)))
        write_bytes(self.folder / RESULTS, b"".join(_line({"case": case, "row": self._rows[case]}) for case in ordered))

    def _append(self, name: str, content: Mapping[str, Any]) -> None:
        path = self.folder / name
        try:
            # One write of one line, so that two runs on one folder do not mix theirs.
            descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
            try:
                os.write(descriptor, _line(content))
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
        except OSError as problem:
            raise PscoverError(f"{path}: cannot be written: {problem.strerror}") from None

    def _lines(self, name: str) -> list[tuple[dict[str, Any], str]]:
        path = self.folder / name
        content = read_bytes(path, TEXT_LIMIT, InvalidResult) if path.exists() else b""
        found = []
        for number, line in enumerate(content.splitlines(), start=1):
            where = f"{path}, line {number}"
            try:
                decoded = msgspec.json.decode(line, type=dict[str, Any])
            except msgspec.DecodeError as problem:
                raise _damaged(where, problem) from None
            found.append((decoded, where))
        return found

    @staticmethod
    def _as(content: Any, type_: type[Any], where: str) -> Any:
        try:
            return msgspec.convert(content, type_)
        except msgspec.ValidationError as problem:
            raise _damaged(where, problem) from None


def run_sweep(
    store: Store[C, R, T], cases: Sequence[C], executors: Executors, done: Callable[[C, R], None] = lambda case, row: None
) -> None:
    """Run the cases that the store does not hold yet, and keep each as soon as it ends.

    Parameters
    ----------
    store
        Where results are kept; its sweep says what to run.
    cases
        Each counts once.
    executors
        Makes an executor (`pscover.evidence.executors`); called again if its workers died.
    done
        Called after each case has been kept, those of before first.

    Raises
    ------
    EngineFailed
        If workers died again and again over the same cases; everything else has been kept.
    Exception
        What a case raised, after all others have been run and kept.

    Examples
    --------
    >>> import tempfile
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Number:
    ...     value: int
    >>> def square(case):
    ...     return Done(row=case.value**2, timing=0.0)
    >>> sweep = Sweep(name="squares", run=square, case=Number, row=int, timing=float)
    >>> cases = [Number(value=k) for k in (3, 2)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = Store(folder, sweep)
    ...     run_sweep(store, cases, lambda: ThreadPoolExecutor(1))
    ...     print([store.row(case) for case in cases], len(Store(folder, sweep).cases))
    [9, 4] 2
    """
    listed = list(dict.fromkeys(cases))
    left = []
    for case in listed:
        row = store.row(case)
        if row is None:
            left.append(case)
        else:
            done(case, row)

    def keep(case: C, measured: tuple[Done[R, T], Machine]) -> None:
        store.save(case, *measured)
        done(case, measured[0].row)

    run_each(left, _Measured(store.sweep.run), executors, keep, _text)
    store.sort(listed)


def _claim(folder: Path, sweep: Sweep[Any, Any, Any]) -> None:
    """Make a folder that of a sweep, or see that it is."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        present = {path.name for path in folder.iterdir()}
    except OSError as problem:
        raise PscoverError(f"{folder}: cannot be made a folder: {problem.strerror}") from None
    path = folder / SETTINGS
    content = {"schema": SCHEMA, "sweep": sweep.name, "settings": dict(sweep.settings)}
    wanted = msgspec.json.format(msgspec.json.encode(content, order="sorted"), indent=2) + b"\n"
    if SETTINGS not in present:
        if present:
            some = ", ".join(sorted(present)[:3])
            raise InvalidSettings(f"{folder}: expected a new or empty folder or one of {sweep.name!r}, got one with {some}")
        write_bytes(path, wanted)
        return
    try:
        found = msgspec.json.decode(read_bytes(path, TEXT_LIMIT, InvalidResult), type=dict[str, Any])
    except msgspec.DecodeError as problem:
        raise _damaged(str(path), problem) from None
    if (found.get("schema"), found.get("sweep")) != (SCHEMA, sweep.name):
        raise InvalidSettings(f"{path}: expected the sweep {sweep.name!r}, got {found.get('sweep')!r}; use another folder")
    settings = msgspec.json.decode(wanted)["settings"]
    if found.get("settings") != settings:
        raise InvalidSettings(f"{path}: {_difference(settings, found.get('settings'))}; use another folder")


def _difference(wanted: Mapping[str, Any], found: Any) -> str:
    if not isinstance(found, dict):
        return f"expected settings, got {found!r}"
    name = next(name for name in sorted({*wanted, *found}) if wanted.get(name) != found.get(name))
    return f"expected the setting {name} to be {wanted.get(name)!r} as in this run, got {found.get(name)!r}"


def _cut_off(path: Path) -> None:
    """Take away a last line that has no end: its writer was killed."""
    if not path.exists():
        return
    content = read_bytes(path, TEXT_LIMIT, InvalidResult)
    whole = content[: content.rfind(b"\n") + 1]
    if whole != content:
        write_bytes(path, whole)


def _check(value: Any, type_: type[Any]) -> None:
    try:
        again = msgspec.json.decode(msgspec.json.encode(value), type=type_)
    except (msgspec.DecodeError, TypeError) as problem:
        raise InvalidResult(
            f"a {type_.__name__} of the sweep: expected what JSON can hold, got {value!r} ({problem})"
        ) from None
    if again != value:
        raise InvalidResult(f"a {type_.__name__} of the sweep: expected {value!r} to be the same after JSON, got {again!r}")


def _line(content: Mapping[str, Any]) -> bytes:
    return msgspec.json.encode(content) + b"\n"


def _text(case: Any) -> str:
    return msgspec.json.encode(case).decode()


def _damaged(where: str, problem: Exception) -> InvalidResult:
    return InvalidResult(f"{where}: expected what a sweep wrote, got something else ({problem}); delete the line")

"""Set-cover problems in the three text formats of the OR-Library.

- **scp** (by rows): m n; the n costs; for each row the number of columns that cover it and the columns.
- **rail** (by columns): m n; for each column its cost, the number of rows it covers and the rows.
- **sts** (Steiner triples): n m; for each of m rows the three columns that cover it. All costs are 1.

Indices count from 1. Covering is certain, p_ij = 1, so that one candidate meets any requirement above 0: every element gets
`REQUIRED`. Beasley 1987, 1990 (scp); Caprara, Fischetti, Toth 1999 (rail); Fulkerson, Nemhauser, Trotter 1974 (sts).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from pscover.errors import InvalidInstance
from pscover.files import TEXT_LIMIT, read_bytes, write_bytes
from pscover.instance import FloatArray, Instance, Meta
from pscover.io.contract import InstanceFormat

REQUIRED = 0.5
"""q_j of every element: any number in (0, 1) asks for exactly one candidate with p_ij = 1."""

INTEGER_LIMIT = 2**31 - 1
IntArray = NDArray[np.int64]


class TextFormat(StrEnum):
    """How the numbers of a file are arranged."""

    SCP = "scp"
    RAIL = "rail"
    STS = "sts"


class _Misfit(Exception):
    """The number at a position is not what the format says it is, so that nothing after it can be told."""

    def __init__(self, position: int, expected: str, got: str = "") -> None:
        super().__init__(position, expected, got)
        self.position, self.expected, self.got = position, expected, got


class _WrongValue(_Misfit):
    """The lists of the format tile the file, but a cost or an index in them is wrong."""


@dataclass(frozen=True, slots=True)
class _Incidence:
    """A set-cover problem: entries (row, column), the position of each in the file, and the costs."""

    shape: tuple[int, int]
    rows: IntArray
    columns: IntArray
    positions: IntArray
    costs: FloatArray


def load(path: Path, text_format: TextFormat | None = None) -> Instance:
    """Read a set-cover problem.

    Parameters
    ----------
    path
        Of the file, at most `pscover.files.TEXT_LIMIT` bytes; it is not trusted.
    text_format
        How its numbers are arranged. By default the suffix says it (`.scp`, `.rail`, `.sts`), or else the content.

    Returns
    -------
    Instance
        With p_ij = 1, `required` = `REQUIRED`, and the file's name as its name.

    Raises
    ------
    InvalidInstance
        With the file, line and number, what was expected and what was found; or if the content fits two formats and
        means different problems in them.
    """
    content = read_bytes(path, TEXT_LIMIT, InvalidInstance)
    tokens = content.split()
    known = text_format or _by_suffix(path)
    misfits, fits = [], []
    try:
        numbers = _numbers(content, tokens)
        for candidate in TextFormat if known is None else (known,):
            try:
                fits.append((candidate, _instance(PARSERS[candidate](numbers), candidate, path)))
            except _Misfit as misfit:
                misfits.append((misfit, candidate))
    except _Misfit as misfit:
        misfits.append((misfit, known or TextFormat.SCP))
    if not fits:
        likeliest, candidate = max(misfits, key=_likelihood)
        hint = "" if known else "; the format is a guess: a file name that ends in .scp, .rail or .sts settles it"
        raise InvalidInstance(f"{path}: read as {candidate}: {_described(likeliest, content, tokens)}{hint}")
    if len({instance.digest for _, instance in fits}) > 1:
        names = " and ".join(candidate for candidate, _ in fits)
        raise InvalidInstance(f"{path}: expected numbers that fit one format, got some that fit {names}: name the file so")
    return fits[0][1]


def save(instance: Instance, path: Path) -> None:
    """Write a set-cover problem: by columns if the file's suffix is `.rail`, else by rows.

    Parameters
    ----------
    instance
        With p_ij = 1 throughout, requirements above 0 (which ones is lost) and no conflicts.
    path
        Where to; names are not kept.

    Raises
    ------
    InvalidInstance
        If the format cannot hold the instance.
    PscoverError
        If the file cannot be written.
    """
    problem = _what_is_lost(instance)
    text_format = _by_suffix(path) or TextFormat.SCP
    if problem is None and text_format is TextFormat.STS:
        problem = "Steiner triples are read only; save as .scp or .rail"
    if problem:
        raise InvalidInstance(f"{path}: {problem}")
    cost = [str(int(c)) if c == int(c) else repr(c) for c in instance.cost.tolist()]
    head = f"{instance.elements} {instance.candidates}"
    if text_format is TextFormat.RAIL:
        lines = [f"{c} {group}" for c, group in zip(cost, _groups(instance.probability), strict=True)]
    else:
        lines = [" ".join(cost), *_groups(csr_array(instance.probability))]
    write_bytes(path, "\n".join([head, *lines, ""]).encode())


instance_format = InstanceFormat(suffixes=(".txt", ".scp", ".rail", ".sts"), load=load, save=save)


def _by_suffix(path: Path) -> TextFormat | None:
    suffix = path.suffix.lower().removeprefix(".")
    return TextFormat(suffix) if suffix in list(TextFormat) else None


def _likelihood(misread: tuple[_Misfit, TextFormat]) -> tuple[bool, bool, int]:
    """How likely the format was meant: it fits but for a value, or far; triples have no lengths that could misfit."""
    misfit, text_format = misread
    return isinstance(misfit, _WrongValue), text_format is not TextFormat.STS, misfit.position


def _numbers(content: bytes, tokens: list[bytes]) -> FloatArray:
    """All numbers of the file; words, NaN and infinities are an error."""
    try:
        # float() takes words such as nan and 1_000: only files without any of their letters go that way.
        if not content.translate(None, b"0123456789+-.eE \t\r\n\v\f"):
            numbers = np.fromiter(map(float, tokens), np.float64, len(tokens))
            if np.isfinite(numbers).all():
                return numbers
    except ValueError:
        pass
    for position, token in enumerate(tokens):
        try:
            good = not token.translate(None, b"0123456789+-.eE") and np.isfinite(float(token))
        except ValueError:
            good = False
        if not good:
            raise _Misfit(position, "a finite number")
    raise _Misfit(0, "numbers separated by blanks")


def _whole(numbers: FloatArray, position: int, low: int, high: int, meaning: str) -> int:
    """The whole number at a position."""
    if position >= len(numbers):
        raise _Misfit(len(numbers), meaning)
    value = float(numbers[position])
    if not low <= value <= high or value != int(value):
        raise _Misfit(position, f"{meaning}: a whole number from {low} to {high}")
    return int(value)


def _sizes(numbers: FloatArray, first: str, second: str) -> tuple[int, int]:
    return (
        _whole(numbers, 0, 1, INTEGER_LIMIT, f"the number of {first}"),
        _whole(numbers, 1, 1, INTEGER_LIMIT, f"the number of {second}"),
    )


def _require_length(numbers: FloatArray, least: int, what: str) -> None:
    """Before anything of a declared size is made: the file is long enough to need it."""
    if len(numbers) < least:
        raise _Misfit(len(numbers), f"at least {least} numbers for {what}", f"a file of {len(numbers)}")


def _records(numbers: FloatArray, at: int, count: int, lead: int, what: str) -> tuple[IntArray, IntArray]:
    """Where the list of each record begins and how long it is; a record is `lead` numbers, a length, and a list."""
    listed = numbers.tolist()
    begins, lengths = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    for k in range(count):
        at += lead
        left = len(listed) - at - 1
        if left < 0:
            raise _Misfit(len(listed), f"{what} {k + 1} of {count}")
        length = listed[at]
        if not 0 <= length <= left or length != int(length):
            raise _Misfit(at, f"the length of the list of {what} {k + 1}: a whole number up to {left}, what is left")
        begins[k], lengths[k] = at + 1, int(length)
        at += 1 + int(length)
    _require_end(numbers, at)
    return begins, lengths


def _require_end(numbers: FloatArray, at: int) -> None:
    if at < len(numbers):
        raise _Misfit(at, "the end of the file")


def _members(numbers: FloatArray, positions: IntArray, size: int, what: str) -> IntArray:
    """The indices at some positions, counted from 0."""
    values = numbers[positions]
    bad = np.flatnonzero((values < 1) | (values > size) | (values != np.floor(values)))
    if len(bad):
        raise _WrongValue(int(positions[bad[0]]), f"a {what}: a whole number from 1 to {size}")
    return values.astype(np.int64) - 1


def _lists(begins: IntArray, lengths: IntArray) -> IntArray:
    """The positions of the entries of lists that begin at `begins`, one list after the other."""
    before = np.cumsum(lengths) - lengths
    return np.repeat(begins - before, lengths) + np.arange(int(lengths.sum()))


def _scp(numbers: FloatArray) -> _Incidence:
    m, n = _sizes(numbers, "rows", "columns")
    _require_length(numbers, 2 + n + m, f"{n} costs and {m} rows")
    begins, lengths = _records(numbers, 2 + n, m, 0, "row")
    _check_costs(numbers, np.arange(2, 2 + n))
    positions = _lists(begins, lengths)
    columns = _members(numbers, positions, n, "column")
    return _Incidence((m, n), np.repeat(np.arange(m), lengths), columns, positions, numbers[2 : 2 + n])


def _rail(numbers: FloatArray) -> _Incidence:
    m, n = _sizes(numbers, "rows", "columns")
    # Rows are not listed, but one that no column covers makes the problem infeasible: each needs a number.
    _require_length(numbers, 2 + max(m, 2 * n), f"{n} columns that cover {m} rows")
    begins, lengths = _records(numbers, 2, n, 1, "column")
    _check_costs(numbers, begins - 2)
    positions = _lists(begins, lengths)
    rows = _members(numbers, positions, m, "row")
    return _Incidence((m, n), rows, np.repeat(np.arange(n), lengths), positions, numbers[begins - 2])


def _sts(numbers: FloatArray) -> _Incidence:
    n, m = _sizes(numbers, "columns", "rows")
    _require_length(numbers, 2 + max(n, 3 * m), f"{m} triples that use {n} columns")
    _require_end(numbers, 2 + 3 * m)
    positions = np.arange(2, 2 + 3 * m)
    columns = _members(numbers, positions, n, "column")
    return _Incidence((m, n), np.repeat(np.arange(m), 3), columns, positions, np.ones(n))


PARSERS: dict[TextFormat, Callable[[FloatArray], _Incidence]] = {
    TextFormat.SCP: _scp,
    TextFormat.RAIL: _rail,
    TextFormat.STS: _sts,
}


def _check_costs(numbers: FloatArray, positions: IntArray) -> None:
    bad = np.flatnonzero(~(numbers[positions] > 0))
    if len(bad):
        raise _WrongValue(int(positions[bad[0]]), "a cost: a number above 0")


def _instance(read: _Incidence, text_format: TextFormat, path: Path) -> Instance:
    # Sorted stably, so that of two equal entries the second comes later in the file too.
    order = np.lexsort((read.rows, read.columns))
    rows, columns = read.rows[order], read.columns[order]
    twice = np.flatnonzero((rows[1:] == rows[:-1]) & (columns[1:] == columns[:-1]))
    if len(twice):
        position = int(read.positions[order[twice + 1]].min())
        raise _WrongValue(position, "each pair of row and column once", "the second one")
    matrix = coo_array((np.ones(len(rows)), (rows, columns)), shape=read.shape)
    return Instance.of(
        matrix, REQUIRED, read.costs, meta=Meta(name=path.stem, source=f"{path.name}, OR-Library format {text_format}")
    )


def _described(misfit: _Misfit, content: bytes, tokens: list[bytes]) -> str:
    """Place, expected and got of a misfit; only now is the line looked for."""
    at = misfit.position
    if at >= len(tokens):
        return f"expected {misfit.expected}, got {misfit.got or 'the end of the file'}"
    got = ", ".join(filter(None, (repr(tokens[at][:40].decode(errors="replace")), misfit.got)))
    seen, place = 0, ""
    for line, text in enumerate(content.splitlines(), start=1):
        before, seen = seen, seen + len(text.split())
        if seen > at:
            place = f"line {line}, number {at - before + 1}"
            break
    return f"{place}: expected {misfit.expected}, got {got}"


def _what_is_lost(instance: Instance) -> str | None:
    """Why the OR-Library's formats cannot hold an instance."""
    p, expected = instance.probability, "OR-Library files hold set cover alone; save as .json or .npz: expected"
    uncertain = np.flatnonzero(p.data < 1)
    if len(uncertain):
        k = int(uncertain[0])
        column = int(np.searchsorted(p.indptr, k, side="right")) - 1
        return f"{expected} p = 1, got {p.data[k]} for element {p.indices[k]}, candidate {column}"
    if len(instance.conflicts):
        return f"{expected} no conflicts, got {len(instance.conflicts)}"
    free = np.flatnonzero(instance.required == 0)
    if len(free):
        return f"{expected} requirements above 0, got 0 for element {free[0]}"
    if not instance.elements or not instance.candidates:
        return f"{expected} at least one row and one column, got {instance.elements} and {instance.candidates}"
    return None


def _groups(matrix: csr_array) -> list[str]:
    """A line for each row of a CSR matrix (or column of a CSC matrix): the length of its list and the list."""
    indices = iter((matrix.indices + 1).tolist())
    return [" ".join(map(str, (length, *islice(indices, length)))) for length in np.diff(matrix.indptr).tolist()]

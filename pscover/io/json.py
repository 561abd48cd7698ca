"""Instances as JSON: readable, one candidate a line, so that two files can be compared line by line.

The document (`InstanceV1`) lists candidates as columns: {"covers": [[element, p], ...], "cost": c}. Its JSON Schema is
`instances/schema/instance-1.json`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, repeat
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from msgspec import UNSET, Struct, UnsetType
from numpy.typing import NDArray
from scipy.sparse import coo_array

from pscover.errors import InvalidInstance
from pscover.files import TEXT_LIMIT, read_bytes, write_bytes
from pscover.instance import INDEX_LIMIT, Instance, Meta
from pscover.io.contract import InstanceFormat
from pscover.io.documents import Versions, quoted

Index = Annotated[int, msgspec.Meta(ge=0, le=INDEX_LIMIT)]
Probability = Annotated[float, msgspec.Meta(gt=0, le=1)]


class Element(Struct, forbid_unknown_fields=True, gc=False):
    """An element: how likely it must be covered, and what it is called."""

    required: Annotated[float, msgspec.Meta(ge=0, lt=1)]
    name: str | UnsetType = UNSET


class Pair(Struct, array_like=True, forbid_unknown_fields=True, gc=False):
    """[element, probability]."""

    element: Index
    probability: Probability


class Candidate(Struct, forbid_unknown_fields=True, gc=False):
    """A candidate: [element, probability] pairs, its cost (1 if absent), its name, and its pose [x, y, theta]."""

    covers: list[Pair]
    cost: Annotated[float, msgspec.Meta(gt=0)] | UnsetType = UNSET
    name: str | UnsetType = UNSET
    pose: tuple[float, float, float] | UnsetType = UNSET


class InstanceV1(Struct, tag_field="schema", tag="pscover.instance/1", forbid_unknown_fields=True):
    """A probabilistic set-cover instance; of each list in `conflicts` at most one candidate may be chosen."""

    elements: list[Element]
    candidates: list[Candidate]
    name: str | UnsetType = UNSET
    source: str | UnsetType = UNSET
    optimum: float | UnsetType | None = UNSET
    conflicts: list[Annotated[list[Index], msgspec.Meta(min_length=2)]] | UnsetType = UNSET


INSTANCE_VERSIONS = Versions(newest=InstanceV1, old=(), error=InvalidInstance)


def decode(content: bytes, source: str | Path = "JSON") -> Instance:
    """An instance from JSON text in UTF-8.

    Parameters
    ----------
    content
        The document; it is not trusted.
    source
        What to call it in messages.

    Raises
    ------
    InvalidInstance
        With the source, the path in the document, what was expected and what was found.

    Examples
    --------
    >>> head = b'{"schema": "pscover.instance/1", "elements": [{"required": 0.7}], '
    >>> decode(head + b'"candidates": [{"covers": [[0, 0.8]]}]}').coverage([0])
    array([0.8])
    >>> decode(head + b'"candidates": [{"covers": [[0, 1.8]]}]}')
    Traceback (most recent call last):
    pscover.errors.InvalidInstance: JSON: $.candidates[0].covers[0][1]: expected float <= 1.0, got 1.8
    """
    try:
        document = INSTANCE_VERSIONS.decode(content, source)
    except InvalidInstance as error:
        lost = "at most length" in str(error)
        raise InvalidInstance((_overlong(content, source) if lost else None) or str(error)) from None
    if _may_repeat_keys(content, document):
        INSTANCE_VERSIONS.require_unique_keys(content, source)
    try:
        return _instance(document)
    except InvalidInstance as error:
        # The door knows indices, not documents: the slow search for the place is paid for by wrong files alone.
        raise InvalidInstance(f"{source}: {_misplaced(document) or error}") from None


def encode(instance: Instance) -> bytes:
    """An instance as JSON text in UTF-8: one element, candidate and conflict a line, every number exact.

    Raises
    ------
    InvalidInstance
        If a name is no text in Unicode.

    Examples
    --------
    >>> print(encode(Instance.of([[0.8, 0.5]], required=0.7, cost=[1, 2.5], conflicts=[(0, 1)])).decode())
    {"schema":"pscover.instance/1",
    "name":"",
    "source":"",
    "optimum":null,
    "elements":[
    {"required":0.7}
    ],
    "candidates":[
    {"covers":[[0,0.8]],"cost":1.0},
    {"covers":[[0,0.5]],"cost":2.5}
    ],
    "conflicts":[
    [0,1]
    ]}
    <BLANKLINE>
    """
    text = msgspec.json.Encoder().encode
    meta = instance.meta
    optimum = None if meta.optimum is None else float(meta.optimum)
    try:
        head = [
            b'{"schema":' + text(str(InstanceV1.__struct_config__.tag)),
            *(b'"%s":%s' % (key, text(value)) for key, value in ((b"name", meta.name), (b"source", meta.source))),
            b'"optimum":' + text(optimum),
        ]
        lists = (
            (b"elements", map(text, _elements(instance))),
            (b"candidates", map(text, _candidates(instance))),
            (b"conflicts", (text(clique.tolist()) for clique in instance.conflicts)),
        )
        body = [b'"%s":[\n%s\n]' % (key, b",\n".join(lines)) for key, lines in lists]
    except UnicodeEncodeError as error:
        raise InvalidInstance(f"expected names that are text in Unicode, got {error.object!r}") from None
    return b",\n".join((*head, *body)) + b"}\n"


def load(path: Path) -> Instance:
    """Read an instance from a JSON file of at most `pscover.files.TEXT_LIMIT` bytes; errors as `decode`."""
    return decode(read_bytes(path, TEXT_LIMIT, InvalidInstance), path)


def save(instance: Instance, path: Path) -> None:
    """Write an instance to a JSON file; errors as `encode` and `pscover.files.write_bytes`."""
    write_bytes(path, encode(instance))


instance_format = InstanceFormat(suffixes=(".json",), load=load, save=save)


def _instance(document: InstanceV1) -> Instance:
    candidates, elements = document.candidates, document.elements
    shape = (len(elements), len(candidates))
    sizes = np.fromiter((len(c.covers) for c in candidates), np.int64, shape[1])
    count = int(sizes.sum())
    rows = np.fromiter((pair.element for c in candidates for pair in c.covers), np.int32, count)
    values = np.fromiter((pair.probability for c in candidates for pair in c.covers), np.float64, count)
    if len(rows) and rows.max() >= shape[0]:
        raise InvalidInstance(f"expected elements below {shape[0]}, got {rows.max()}")
    columns = np.repeat(np.arange(shape[1], dtype=np.int32), sizes)
    meta = Meta(
        name=document.name or "",
        source=document.source or "",
        elements=_names([e.name for e in elements]),
        candidates=_names([c.name for c in candidates]),
        poses=_poses([c.pose for c in candidates]),
        optimum=None if document.optimum is UNSET else document.optimum,
    )
    return Instance.of(
        coo_array((values, (rows, columns)), shape=shape),
        required=np.fromiter((e.required for e in elements), np.float64, shape[0]),
        cost=np.fromiter((1.0 if c.cost is UNSET else c.cost for c in candidates), np.float64, shape[1]),
        conflicts=document.conflicts or (),
        meta=meta,
    )


def _names(given: list[str | UnsetType]) -> tuple[str, ...]:
    """All names, those that are absent replaced by the index; none if all are absent."""
    if all(name is UNSET for name in given):
        return ()
    return tuple(str(k) if name is UNSET else name for k, name in enumerate(given))


def _poses(given: list[tuple[float, float, float] | UnsetType]) -> NDArray[np.float64] | None:
    if all(pose is UNSET for pose in given):
        return None
    if any(pose is UNSET for pose in given):
        raise InvalidInstance("expected a pose of every candidate or of none")
    return np.array(given, dtype=np.float64)


def _elements(instance: Instance) -> Iterator[Element]:
    names: Iterable[str | UnsetType] = instance.meta.elements or repeat(UNSET)
    return (Element(required, name) for required, name in zip(instance.required.tolist(), names, strict=False))


def _candidates(instance: Instance) -> Iterator[Candidate]:
    p, meta = instance.probability, instance.meta
    starts, rows, values = p.indptr.tolist(), p.indices.tolist(), p.data.tolist()
    names: Iterable[str | UnsetType] = meta.candidates or repeat(UNSET)
    poses: Iterable[tuple[float, float, float] | UnsetType] = repeat(UNSET) if meta.poses is None else meta.poses.tolist()
    for i, cost, name, pose in zip(range(instance.candidates), instance.cost.tolist(), names, poses, strict=False):
        span = slice(starts[i], starts[i + 1])
        yield Candidate(list(map(Pair, rows[span], values[span])), cost, name, pose)


def _may_repeat_keys(content: bytes, document: InstanceV1) -> bool:
    """Whether the text has more strings than the document: a key that is given twice, whose first value is lost.

    Without escapes every string has two quotation marks. With escapes the answer is that it may be so.
    """
    elements, candidates = document.elements, document.candidates
    names = sum(name is not UNSET for name in chain((e.name for e in elements), (c.name for c in candidates)))
    fields = len(elements) + len(candidates) + sum((c.cost is not UNSET) + (c.pose is not UNSET) for c in candidates)
    head = sum(getattr(document, field) is not UNSET for field in document.__struct_fields__)
    texts = (document.name is not UNSET) + (document.source is not UNSET)
    # "schema" and its value are no field; a name is a key and a value.
    strings = 2 + head + texts + fields + 2 * names
    return b"\\" in content or content.count(b'"') != 2 * strings


def _overlong(content: bytes, source: str | Path) -> str | None:
    """Where an array has too many entries: msgspec reports the place of all errors but this one."""
    try:
        for i, candidate in enumerate(msgspec.json.decode(content)["candidates"]):
            for k, pair in enumerate(candidate["covers"]):
                if isinstance(pair, list) and len(pair) > 2:
                    return f"{source}: $.candidates[{i}].covers[{k}]: expected [element, p], got {quoted(pair)}"
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, LookupError, TypeError):
        pass
    return None


def _misplaced(document: InstanceV1) -> str | None:
    """The first place at which parts of a document contradict each other."""
    elements, candidates = len(document.elements), len(document.candidates)
    for i, candidate in enumerate(document.candidates):
        seen: set[int] = set()
        for k, element in enumerate(pair.element for pair in candidate.covers):
            place = f"$.candidates[{i}].covers[{k}][0]"
            if element >= elements:
                return f"{place}: expected an element below {elements}, got {element}"
            if element in seen:
                return f"{place}: expected each element once in a candidate, got {element} twice"
            seen.add(element)
    for k, clique in enumerate(document.conflicts or ()):
        seen = set()
        for position, member in enumerate(clique):
            place = f"$.conflicts[{k}][{position}]"
            if member >= candidates:
                return f"{place}: expected a candidate below {candidates}, got {member}"
            if member in seen:
                return f"{place}: expected each candidate once in a conflict, got {member} twice"
            seen.add(member)
    posed = [candidate.pose is not UNSET for candidate in document.candidates]
    if any(posed) and not all(posed):
        return f"$.candidates[{posed.index(False)}]: expected a pose, as other candidates have one, got none"
    return None

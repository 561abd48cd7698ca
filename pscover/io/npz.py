"""Instances as NumPy archives: for instances with more than some 100 000 stored probabilities.

The archive holds the arrays `indptr`, `indices`, `data` (p, by columns), `required`, `cost`, `conflict_starts`,
`conflict_members`, perhaps `poses`, and `header`: the bytes of a JSON document (`HeaderV1`) with the schema's version and
the names. `numpy.load` opens it. Written uncompressed, so that equal instances give equal bytes whatever the version of
zlib; compressed archives are read too.

An archive may declare far more than it holds. Every declared size is compared with the file's length, and every array's
declared shape with its bytes, before anything of that size is made; nothing is ever unpickled.
"""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path
from typing import Any, NoReturn

import msgspec
import numpy as np
from msgspec import Struct
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.cliques import Cliques
from pscover.errors import InvalidInstance
from pscover.files import BYTE_LIMIT, opened, write_bytes
from pscover.instance import INDEX_LIMIT, Instance, Meta
from pscover.io.contract import InstanceFormat
from pscover.io.documents import Versions

ALWAYS_UNPACKED = 2**26
"""Archives may unpack to 64 MiB whatever their length."""

MOST_UNPACKED_RATIO = 100
"""Larger ones may unpack to this many times their length: deflate reaches 1032, probabilities some 3."""

FLOATS = ("<f8", ">f8", "<f4", ">f4")
INTEGERS = ("<i4", ">i4", "<i8", ">i8", "<u4", ">u4")
ARRAYS = {
    "header": ("|u1",),
    "indptr": INTEGERS,
    "indices": INTEGERS,
    "data": FLOATS,
    "required": FLOATS,
    "cost": FLOATS,
    "conflict_starts": INTEGERS,
    "conflict_members": INTEGERS,
    "poses": FLOATS,
}
OPTIONAL = {"poses"}
LITERAL = re.compile(
    rb"\{ *'descr' *: *'([^'\\]{1,16})' *, *'fortran_order' *: *(True|False) *, *'shape' *: *\(([0-9, ]{0,64})\) *,? *\}\s*"
)


class HeaderV1(Struct, tag_field="schema", tag="pscover.instance/1", forbid_unknown_fields=True):
    """What an archive holds besides arrays; `elements` and `candidates` are their names, or empty."""

    name: str = ""
    source: str = ""
    optimum: float | None = None
    elements: list[str] = []
    candidates: list[str] = []


HEADER_VERSIONS = Versions(newest=HeaderV1, old=(), error=InvalidInstance)


def load(path: Path) -> Instance:
    """Read an instance from a NumPy archive.

    Parameters
    ----------
    path
        Of the archive; it is not trusted.

    Raises
    ------
    InvalidInstance
        With the file, the array in it, what was expected and what was found.
    """
    with opened(path, BYTE_LIMIT, InvalidInstance) as file:
        length = file.seek(0, io.SEEK_END)
        try:
            with zipfile.ZipFile(file) as archive:
                _check_members(archive, length, path)
                contents = {_stem(member): archive.read(member) for member in archive.infolist()}
        except (InvalidInstance, MemoryError):
            raise
        except Exception as error:
            # A damaged archive makes zipfile and zlib raise errors of a dozen types.
            raise InvalidInstance(f"{path}: expected a NumPy archive (.npz), got a damaged file: {error}") from None
    arrays = {name: _array(content, name, path) for name, content in contents.items()}
    content = arrays["header"].tobytes()
    header = HEADER_VERSIONS.decode(content, f"{path}: header")
    HEADER_VERSIONS.require_unique_keys(content, f"{path}: header")
    try:
        return _instance(arrays, header)
    except InvalidInstance as error:
        raise InvalidInstance(f"{path}: {error}") from None


def save(instance: Instance, path: Path) -> None:
    """Write an instance to a NumPy archive.

    Raises
    ------
    InvalidInstance
        If a name is no text in Unicode, or the archive would have more than `pscover.files.BYTE_LIMIT` bytes.
    PscoverError
        If the file cannot be written.
    """
    p, meta = instance.probability, instance.meta
    header = HeaderV1(
        name=meta.name,
        source=meta.source,
        optimum=None if meta.optimum is None else float(meta.optimum),
        elements=list(meta.elements),
        candidates=list(meta.candidates),
    )
    try:
        text = msgspec.json.encode(header)
    except UnicodeEncodeError as error:
        raise InvalidInstance(f"expected names that are text in Unicode, got {error.object!r}") from None
    arrays: dict[str, tuple[Any, str]] = {
        "header": (np.frombuffer(text, dtype=np.uint8), "|u1"),
        "indptr": (p.indptr, "<i4"),
        "indices": (p.indices, "<i4"),
        "data": (p.data, "<f8"),
        "required": (instance.required, "<f8"),
        "cost": (instance.cost, "<f8"),
        "conflict_starts": (instance.conflicts.starts, "<i4"),
        "conflict_members": (instance.conflicts.members, "<i4"),
    }
    if meta.poses is not None:
        arrays["poses"] = (meta.poses, "<f8")
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
        for name, (array, kind) in arrays.items():
            packed = io.BytesIO()
            np.lib.format.write_array(packed, np.ascontiguousarray(array, dtype=kind), version=(1, 0), allow_pickle=False)
            archive.writestr(_member(f"{name}.npy"), packed.getbuffer())
    if content.tell() > BYTE_LIMIT:
        raise InvalidInstance(f"{path}: expected an instance of at most {BYTE_LIMIT} bytes, got {content.tell()}")
    write_bytes(path, content.getvalue())


instance_format = InstanceFormat(suffixes=(".npz",), load=load, save=save)


def _member(name: str) -> zipfile.ZipInfo:
    """An entry that says nothing of when and on which system it was made."""
    entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
    entry.create_system = 3
    entry.external_attr = 0o644 << 16
    return entry


def _stem(member: zipfile.ZipInfo) -> str:
    return member.filename.removesuffix(".npy")


def _check_members(archive: zipfile.ZipFile, length: int, path: Path) -> None:
    """The archive lists the arrays it should, once each, and does not declare more than its length can hold."""
    members = archive.infolist()
    names = [member.filename for member in members[: 2 * len(ARRAYS)]]
    for name in names:
        if not name.endswith(".npy") or name.removesuffix(".npy") not in ARRAYS or names.count(name) > 1:
            raise InvalidInstance(f"{path}: expected the arrays {', '.join(ARRAYS)}, once each, got {name[:40]!r}")
    missing = [name for name in ARRAYS if f"{name}.npy" not in names and name not in OPTIONAL]
    if missing:
        raise InvalidInstance(f"{path}: expected an array {missing[0]!r}, got only {', '.join(names) or 'none'}")
    for member in members:
        if member.flag_bits & 1 or member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InvalidInstance(f"{path}: {_stem(member)}: expected a stored or deflated array, got another packing")
    declared = sum(member.file_size for member in members)
    limit = min(BYTE_LIMIT, max(ALWAYS_UNPACKED, MOST_UNPACKED_RATIO * length))
    if declared > limit:
        raise InvalidInstance(
            f"{path}: expected an archive of {length} bytes to unpack to at most {limit} bytes, got {declared}"
        )


def _array(content: bytes, name: str, path: Path) -> NDArray[Any]:
    """The array in the bytes of a .npy file whose declared type and shape fit those bytes, without a copy."""

    def fail(expected: str, got: object) -> NoReturn:
        raise InvalidInstance(f"{path}: {name}: expected {expected}, got {got}")

    major = content[6] if len(content) > 10 and content[:6] == b"\x93NUMPY" else 0
    if major not in (1, 2, 3):
        fail("an array in NumPy's format (.npy) of version 1 to 3", repr(content[:8]))
    width = 2 if major == 1 else 4
    begin = 8 + width
    end = begin + int.from_bytes(content[8:begin], "little")
    found = LITERAL.fullmatch(content[begin:end]) if end - begin <= 10_000 else None
    if found is None:
        fail("a header with descr, fortran_order and shape", repr(content[begin : begin + 60]))
    kind, order, dimensions = found[1].decode("latin-1"), found[2] == b"True", re.findall(rb"\d+", found[3])
    if kind not in ARRAYS[name]:
        fail(f"numbers of type {' or '.join(ARRAYS[name])}", repr(kind))
    shape = tuple(int(size) for size in dimensions)
    if len(shape) != (2 if name == "poses" else 1):
        fail(f"{2 if name == 'poses' else 1} dimension(s)", f"shape {shape}")
    entries = 1
    for size in shape:
        entries *= size
    if entries * np.dtype(kind).itemsize != len(content) - end:
        fail(f"as many bytes as the shape {shape} of {kind} takes", len(content) - end)
    array = np.frombuffer(content, dtype=kind, offset=end).reshape(shape, order="F" if order else "C")
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def _instance(arrays: dict[str, NDArray[Any]], header: HeaderV1) -> Instance:
    starts, rows = arrays["indptr"].astype(np.int64), arrays["indices"].astype(np.int64)
    values, required, cost = arrays["data"], arrays["required"], arrays["cost"]
    shape = (len(required), len(cost))
    if max(shape) > INDEX_LIMIT or len(starts) != shape[1] + 1:
        raise InvalidInstance(f"indptr: expected one entry more than cost has ({shape[1]}), got {len(starts)}")
    if starts[0] != 0 or starts[-1] != len(rows) or (np.diff(starts) < 0).any():
        raise InvalidInstance(f"indptr: expected numbers that rise from 0 to {len(rows)}, the length of indices")
    if len(values) != len(rows):
        raise InvalidInstance(f"data: expected as many entries as indices has ({len(rows)}), got {len(values)}")
    outside = np.flatnonzero((rows < 0) | (rows >= shape[0]))
    if len(outside):
        place = outside[0]
        raise InvalidInstance(f"indices[{place}]: expected an element from 0 to {shape[0] - 1}, got {rows[place]}")
    meta = Meta(
        name=header.name,
        source=header.source,
        elements=tuple(header.elements),
        candidates=tuple(header.candidates),
        poses=arrays.get("poses"),
        optimum=header.optimum,
    )
    conflicts = Cliques.flat(arrays["conflict_starts"], arrays["conflict_members"])
    return Instance.of(csc_array((values, rows, starts), shape=shape), required, cost, conflicts, meta)

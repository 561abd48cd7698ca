"""JSON documents of other tools: typed where we look, ignored elsewhere, and never larger in memory than they may be."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import msgspec

from pscover.errors import InvalidImage
from pscover.files import read_bytes
from pscover.io.documents import explain

Content = TypeVar("Content")

TEXT_LIMIT = 2**26
"""Annotation files of more than 64 MiB of text are refused."""

OBJECT_LIMIT = 2**18
"""A document may have this many objects: each takes some 500 bytes."""

NUMBER_LIMIT = 2**22
"""A mask may have this many numbers or, in a document, values: each takes some 32 bytes."""

EXPLAINED = 2**22
"""In longer documents the wrong value itself is not shown: to find it takes an untyped copy of the whole."""


def read_document(path: Path) -> bytes:
    """The text of an annotation file, with few enough objects to be decoded.

    Raises
    ------
    InvalidImage
        If it cannot be read or is beyond the limits.
    """
    content = read_bytes(path, TEXT_LIMIT, InvalidImage)
    if content.count(b"{") > OBJECT_LIMIT:
        raise InvalidImage(f"{path}: expected at most {OBJECT_LIMIT} objects, got more; keep the annotations of one image")
    return content


def decode(content: bytes | msgspec.Raw, kind: type[Content], place: str) -> Content:
    """JSON text as a value of some type.

    Parameters
    ----------
    content
        Not to be trusted.
    kind
        The type.
    place
        Where the text stands: a file, or a file and a path in it.

    Raises
    ------
    InvalidImage
        With the place, what was expected and what was found.
    """
    try:
        return msgspec.json.decode(content, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        text = bytes(content)
        if len(text) > EXPLAINED and isinstance(error, msgspec.ValidationError):
            told = str(error).replace("`", "")
        else:
            told = explain(text, error)
        inner = "$" in place and told.startswith("$")
        raise InvalidImage(place + told[1:] if inner else f"{place}: {told}") from None
    except RecursionError:
        raise InvalidImage(f"{place}: expected a document of a few levels, got one nested too deeply") from None


def convert(value: object, kind: type[Content], place: str) -> Content:
    """A value of another library as one of some type; errors as `decode`."""
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise InvalidImage(f"{place}: {str(error).replace('`', '')}") from None


def is_object(content: msgspec.Raw) -> bool:
    """Whether a value is an object rather than a list or something else."""
    return bytes(memoryview(content)[:1]) == b"{"


def few_numbers(content: msgspec.Raw, place: str) -> msgspec.Raw:
    """The text itself, if it has at most `NUMBER_LIMIT` values; `InvalidImage` otherwise."""
    if bytes(content).count(b",") > NUMBER_LIMIT:
        raise InvalidImage(f"{place}: expected at most {NUMBER_LIMIT} numbers in a mask, got more")
    return content

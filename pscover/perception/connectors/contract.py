"""The contract of an annotation format: a file in `pscover/perception/connectors/` with an `annotation_format`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pscover.perception.mask import Mask


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Annotations:
    """Masks of one image that were made elsewhere: by hand, by another segmenter, in another tool.

    Parameters
    ----------
    masks
        In the order of the file; they may overlap, nest and leave gaps. Each has at least one pixel, within the image.
    shape
        Height and width of the image in pixels.
    source
        Where the masks came from.
    image
        The file name of the image that they describe, as the annotations say it, or "".
    """

    masks: tuple[Mask, ...]
    shape: tuple[int, int]
    source: str = ""
    image: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What an unknown file looks like.

    Parameters
    ----------
    path
        Of the file.
    head
        Its first bytes; empty for a folder.
    document
        "list" or "object" if it is a JSON document, else "".
    fields
        Those of the fields that tell formats apart which the document, or the first entry of the list, has.
    """

    path: Path
    head: bytes = b""
    document: str = ""
    fields: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What to read.

    Parameters
    ----------
    path
        Of the file or folder; it is not trusted.
    shape
        Height and width that the image must have, or None where the file says it.
    image
        Which of several images: its file name or its number; None where there is one.
    """

    path: Path
    shape: tuple[int, int] | None = None
    image: str | int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnotationFormat:
    """How masks are kept in files of some kind.

    Parameters
    ----------
    name
        Of the format.
    recognises
        Whether a file looks like one of this format. No two formats recognise the same file.
    read
        Reads an untrusted file; raises `InvalidImage`, or `MissingDependency` where an optional package is needed.
    encode
        The bytes of a file, or None if the format is only read. Raises `InvalidImage` if the format cannot hold the masks.
    suffixes
        Of files to be written in this format, lower case, with the dot; no two formats share one.
    """

    name: str
    recognises: Callable[[Sample], bool]
    read: Callable[[Request], Annotations]
    encode: Callable[[Annotations], bytes] | None = None
    suffixes: tuple[str, ...] = ()

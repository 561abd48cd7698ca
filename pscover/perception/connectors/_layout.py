"""Telling annotation files apart by their content."""

from __future__ import annotations

from pathlib import Path

import msgspec

from pscover.errors import InvalidImage
from pscover.files import opened
from pscover.images import BYTE_LIMIT
from pscover.perception.connectors._documents import decode, read_document
from pscover.perception.connectors.contract import Sample

HEAD = 4096

ABSENT = msgspec.Raw()


class Marks(msgspec.Struct):
    """The fields by which formats differ, undecoded."""

    annotations: msgspec.Raw = ABSENT
    images: msgspec.Raw = ABSENT
    image: msgspec.Raw = ABSENT
    image_id: msgspec.Raw = ABSENT
    segmentation: msgspec.Raw = ABSENT
    shapes: msgspec.Raw = ABSENT

    @property
    def present(self) -> frozenset[str]:
        """The names of those that the document has."""
        return frozenset(name for name in self.__struct_fields__ if bytes(getattr(self, name)))


def sample(path: Path) -> Sample:
    """What a file or folder looks like; a folder looks like nothing.

    Raises
    ------
    InvalidImage
        If it cannot be read, or begins like JSON and is none.
    """
    try:
        folder = path.is_dir()
    except ValueError:
        folder = False
    if folder:
        return Sample(path=path)
    with opened(path, BYTE_LIMIT, InvalidImage) as file:
        try:
            head = file.read(HEAD)
        except OSError as problem:
            raise InvalidImage(f"{path}: cannot be read: {problem.strerror}") from None
    if not head:
        raise InvalidImage(f"{path}: expected annotations, got an empty file")
    start = head.lstrip()[:1]
    if start == b"{":
        return Sample(path=path, head=head, document="object", fields=decode(read_document(path), Marks, str(path)).present)
    if start == b"[":
        entries = decode(read_document(path), list[Marks], str(path))
        return Sample(path=path, head=head, document="list", fields=entries[0].present if entries else frozenset())
    return Sample(path=path, head=head)

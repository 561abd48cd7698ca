"""Masks made elsewhere, in files of other tools: what a file is, its content says.

Read are the records of Segment Anything's mask generators (JSON, or the folder that `amg.py` writes), COCO JSON, LabelMe
JSON, label images (PNG), and NumPy arrays of labels or masks. Written are label images and COCO JSON.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from os import PathLike
from pathlib import Path

from pscover.errors import InvalidImage, UnknownName
from pscover.files import write_bytes
from pscover.perception import connectors
from pscover.perception.connectors._layout import sample
from pscover.perception.connectors.contract import AnnotationFormat, Annotations, Request

__all__ = ["Annotations", "format_names", "format_of", "read_annotations", "write_annotations"]


def read_annotations(
    path: str | PathLike[str],
    shape: tuple[int, int] | None = None,
    format: str | None = None,  # noqa: A002 - the word that everybody uses
    image: str | int | None = None,
) -> Annotations:
    """Masks from a file, or a folder, that may hold anything.

    Parameters
    ----------
    path
        Of the file or folder.
    shape
        Height and width of the photo: what the masks must fit, and what polygons need where the file does not say it.
    format
        One of `format_names()`; by default the content decides.
    image
        Which image, by its file name or number, where a file describes several.

    Returns
    -------
    Annotations

    Raises
    ------
    InvalidImage
        If the file cannot be read, is damaged, or does not fit the photo: with the file, the place in it, what was expected
        and what was found.
    UnknownName
        For an unknown format.
    MissingDependency
        For a PNG without OpenCV.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(Path(folder, "labels.npy"), np.array([[0, 1, 1], [2, 2, 0]]))
    ...     found = read_annotations(Path(folder, "labels.npy"))
    ...     write_annotations(found, Path(folder, "labels.json"))
    ...     again = read_annotations(Path(folder, "labels.json"), shape=(2, 3))
    >>> [(mask.left, mask.top, mask.area) for mask in again.masks]
    [(1, 0, 2), (0, 1, 2)]
    """
    place = Path(path)
    chosen = None if format is None else _named(format)
    try:
        known = chosen or _recognised(place)
        return known.read(Request(path=place, shape=shape, image=image))
    except MemoryError:
        raise InvalidImage(f"{path}: reading it takes more memory than there is") from None


def write_annotations(
    annotations: Annotations,
    path: str | PathLike[str],
    format: str | None = None,  # noqa: A002
) -> None:
    """Write masks to a file, whole or not at all.

    Parameters
    ----------
    annotations
        What to write.
    path
        Where to.
    format
        "label-png" (one label a pixel, small masks on top of large ones; a mask's label is its place in the order, from 1),
        "coco" (exact) or "coco-compressed" (exact and smaller, needs pycocotools); by default `.png` and `.json` decide
        between the first two.

    Raises
    ------
    InvalidImage
        If the suffix is unknown or the format cannot hold the masks.
    UnknownName
        For an unknown format.
    PscoverError
        If the file cannot be written; an existing file is then as it was.
    """
    place = Path(path)
    if format is None:
        written = {suffix: known for known in _formats().values() for suffix in known.suffixes}
        found = written.get(place.suffix.lower())
        if found is None:
            names = ", ".join(sorted(written))
            raise InvalidImage(f"{path}: expected a file name that ends in one of {names}, got {place.suffix!r}")
    else:
        found = _named(format)
    if found.encode is None:
        names = ", ".join(sorted(known.name for known in _formats().values() if known.encode))
        raise InvalidImage(f"{path}: expected a format that can be written ({names}), got {found.name!r}")
    write_bytes(place, found.encode(annotations))


def format_of(path: str | PathLike[str]) -> str:
    """The name of the format that a file, or folder, is in.

    Raises
    ------
    InvalidImage
        If it is in none, or cannot be read.
    """
    return _recognised(Path(path)).name


def format_names() -> tuple[str, ...]:
    """The names of all known annotation formats, sorted.

    Examples
    --------
    >>> format_names()
    ('coco', 'coco-compressed', 'label-png', 'labelme', 'numpy', 'sam-folder', 'sam-records')
    """
    return tuple(sorted(_formats()))


def _named(name: str) -> AnnotationFormat:
    if name not in _formats():
        raise UnknownName.among("annotation format", name, _formats())
    return _formats()[name]


def _recognised(path: Path) -> AnnotationFormat:
    found = sample(path)
    for known in _formats().values():
        if known.recognises(found):
            return known
    got = f"a JSON {found.document} of another kind" if found.document else repr(found.head[:12])
    raise InvalidImage(
        f"{path}: expected annotations ({', '.join(format_names())}), got {got}; say the format if this is one of them"
    )


@cache
def _formats() -> dict[str, AnnotationFormat]:
    found: dict[str, AnnotationFormat] = {}
    for name in sorted(module.name for module in pkgutil.iter_modules(connectors.__path__)):
        module = importlib.import_module(f"{connectors.__name__}.{name}")
        for value in vars(module).values():
            if isinstance(value, AnnotationFormat):
                found[value.name] = value
    return found

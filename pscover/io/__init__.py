"""Instances and results in files; the format is chosen by the file's suffix.

A module of this package with a module-level `instance_format` is a format. `.json` is readable and can be compared line
by line; `.npz` is for instances above some 100 000 stored probabilities; `.txt`, `.scp`, `.rail` and `.sts` are the
OR-Library's set-cover formats.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
from functools import cache
from pathlib import Path

from pscover.errors import InvalidInstance
from pscover.instance import Instance
from pscover.io.contract import InstanceFormat
from pscover.io.mps import write_mps
from pscover.io.result import load_result, save_result

__all__ = ["InstanceFormat", "load_instance", "load_result", "save_instance", "save_result", "suffixes", "write_mps"]


def load_instance(path: str | os.PathLike[str]) -> Instance:
    """Read an instance from a file that may hold anything.

    Parameters
    ----------
    path
        Of the file; its suffix says which format it has.

    Returns
    -------
    Instance

    Raises
    ------
    InvalidInstance
        If the file cannot be read or does not describe an instance: with the file, the place in it, what was expected
        and what was found.

    Examples
    --------
    >>> import tempfile
    >>> instance = Instance.of([[0.8, 0.5], [0.0, 0.9]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_instance(instance, Path(folder, "two.json"))
    ...     load_instance(Path(folder, "two.json")).digest == instance.digest
    True
    """
    path = Path(path)
    try:
        return _format(path).load(path)
    except MemoryError:
        raise InvalidInstance(f"{path}: reading it takes more memory than there is") from None


def save_instance(instance: Instance, path: str | os.PathLike[str]) -> None:
    """Write an instance to a file; equal instances give equal bytes.

    Parameters
    ----------
    instance
        What to write.
    path
        Where to; its suffix says in which format.

    Raises
    ------
    InvalidInstance
        If the suffix is unknown or the format cannot hold the instance.
    PscoverError
        If the file cannot be written; an existing file is then as it was.
    """
    path = Path(path)
    _format(path).save(instance, path)


def suffixes() -> tuple[str, ...]:
    """The suffixes of all known instance formats, sorted.

    Examples
    --------
    >>> suffixes()
    ('.json', '.npz', '.rail', '.scp', '.sts', '.txt')
    """
    return tuple(sorted(_formats()))


def _format(path: Path) -> InstanceFormat:
    found = _formats().get(path.suffix.lower())
    if found is None:
        known = ", ".join(suffixes())
        raise InvalidInstance(f"{path}: expected a file name that ends in one of {known}, got {path.suffix!r}")
    return found


@cache
def _formats() -> dict[str, InstanceFormat]:
    found: dict[str, InstanceFormat] = {}
    for name in sorted(module.name for module in pkgutil.iter_modules(__path__)):
        module = importlib.import_module(f"{__name__}.{name}")
        if isinstance(known := getattr(module, "instance_format", None), InstanceFormat):
            found.update(dict.fromkeys(known.suffixes, known))
    return found

"""The contract of an instance format: a file in `pscover/io/` with a module-level `instance_format`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pscover.instance import Instance


@dataclass(frozen=True, slots=True, kw_only=True)
class InstanceFormat:
    """How instances are kept in files of some kind.

    Parameters
    ----------
    suffixes
        Of the files, lower case, with the dot; no two formats share one.
    load
        Reads an untrusted file; raises `InvalidInstance` and nothing else.
    save
        Writes a file, whole or not at all; raises `InvalidInstance` if the format cannot hold the instance and
        `PscoverError` if the file cannot be written. Equal instances give equal bytes.
    """

    suffixes: tuple[str, ...]
    load: Callable[[Path], Instance]
    save: Callable[[Instance, Path], None]

"""What something was measured on: processor, system, and the versions of the packages that did the work."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGES = ("pscover", "numpy", "scipy", "highspy", "numba", "opencv-python-headless", "scikit-image", "onnxruntime")
"""Those whose versions are noted, where they are installed; so are the packages of all engines."""
ENGINES = ("PySCIPOpt", "ortools", "cvxpy", "pyomo")


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """A computer and its software.

    Parameters
    ----------
    processor
        Its model, as the system names it.
    cores
        How many it has for this process.
    system, python
        Their names and versions.
    packages
        Names and versions of installed packages.
    """

    processor: str
    cores: int
    system: str
    python: str
    packages: tuple[tuple[str, str], ...]


@cache
def this_machine() -> Machine:
    """The one that this process runs on.

    Examples
    --------
    >>> dict(this_machine().packages)["pscover"] == metadata.version("pscover")
    True
    """
    return Machine(
        processor=_processor(),
        cores=len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        system=platform.platform(),
        python=platform.python_version(),
        packages=tuple((name, version) for name in (*PACKAGES, *ENGINES) if (version := _version(name))),
    )


def _processor() -> str:
    listing = Path("/proc/cpuinfo")
    try:
        lines = listing.read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""

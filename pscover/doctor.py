"""What is installed of all that pscover can use, read from its own metadata."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib import metadata

REQUIREMENT = re.compile(
    r"""(?P<name>[A-Za-z0-9._-]+)\s*(?:\[(?P<extras>[^\]]*)\])?\s*(?P<range>[^;]*?)\s*(?:;.*extra\s*==\s*["'](?P<extra>[^"']+)["'])?\s*$"""
)
"""A line such as `scipy>=1.11; extra == "plan"` of a package's metadata."""
GATHERING = frozenset({"all", "test", "docs"})
"""Extras that only gather others, or serve who works on pscover."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Package:
    """A package that something needs.

    Parameters
    ----------
    name
        As pip knows it.
    needed
        Which versions will do, such as ">=1.5", or "".
    found
        The version that is installed, or None.
    """

    name: str
    needed: str
    found: str | None

    @property
    def is_there(self) -> bool:
        """Whether it is installed in a version that will do."""
        return self.found is not None and all(_holds(self.found, part) for part in self.needed.split(","))


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Something that pscover can do, and the packages that it takes.

    Parameters
    ----------
    extra
        The extra that brings the packages; "" for the core.
    packages
        All of them, those of the extras that it includes too, sorted by name.
    """

    extra: str
    packages: tuple[Package, ...]

    @property
    def is_complete(self) -> bool:
        """Whether every package is there."""
        return all(package.is_there for package in self.packages)

    @property
    def install(self) -> str:
        """The line that brings what is missing."""
        return f'pip install "pscover[{self.extra}]"' if self.extra else "pip install --upgrade pscover"


def parts() -> tuple[Part, ...]:
    """The core, then every extra in alphabetical order.

    Examples
    --------
    >>> core, *extras = parts()
    >>> core.is_complete, "numpy" in [package.name for package in core.packages]
    (True, True)
    >>> [package.name for part in extras if part.extra == "engine" for package in part.packages]
    ['numba']
    """
    lines = tuple(metadata.requires("pscover") or ())
    extras = sorted({extra for _, extra in map(_read, lines) if extra} - GATHERING)
    return tuple(Part(extra=extra, packages=_packages(lines, extra)) for extra in ("", *extras))


@dataclass(frozen=True, slots=True)
class _Requirement:
    name: str
    needed: str
    extras: tuple[str, ...]


def _read(line: str) -> tuple[_Requirement, str]:
    """A line of the metadata, and the extra that it belongs to."""
    match = REQUIREMENT.match(line)
    if match is None:
        return _Requirement(line, "", ()), ""
    inner = tuple(name.strip() for name in (match["extras"] or "").split(",") if name.strip())
    return _Requirement(match["name"], match["range"].strip("() "), inner), match["extra"] or ""


def _packages(lines: tuple[str, ...], extra: str) -> tuple[Package, ...]:
    found: dict[str, Package] = {}
    for requirement in _gathered(lines, extra, frozenset()):
        found[requirement.name] = Package(name=requirement.name, needed=requirement.needed, found=_version(requirement.name))
    return tuple(found[name] for name in sorted(found))


def _gathered(lines: tuple[str, ...], extra: str, seen: frozenset[str]) -> Iterable[_Requirement]:
    """What an extra requires, extras of pscover that it includes opened."""
    for line in lines:
        requirement, own = _read(line)
        if own != extra:
            continue
        if requirement.name != "pscover":
            yield requirement
            continue
        for inner in requirement.extras:
            if inner not in seen:
                yield from _gathered(lines, inner, seen | {extra})


@cache
def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _holds(version: str, condition: str) -> bool:
    """Whether a version meets ">=1.5" or "==2.13.0"; other conditions are taken as met."""
    condition = condition.strip()
    if condition.startswith(">="):
        return _numbers(version) >= _numbers(condition[2:])
    if condition.startswith("=="):
        return _numbers(version) == _numbers(condition[2:])
    return True


def _numbers(version: str) -> tuple[int, ...]:
    """The leading numbers of a version, without trailing zeros: what tells 1.10 from 1.9."""
    match = re.match(r"\d+(?:\.\d+)*", version.strip())
    numbers = [] if match is None else [int(part) for part in match[0].split(".")]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)

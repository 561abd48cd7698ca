"""Every error that pscover raises on purpose.

All derive from `PscoverError`, so that an embedding program can catch one type. Each message says what was expected,
what was found and where, and what to do about it.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class PscoverError(Exception):
    """Base of all errors raised by pscover."""


class InvalidInstance(PscoverError, ValueError):
    """The data do not describe a probabilistic set-cover instance."""


class InvalidImage(PscoverError, ValueError):
    """An image or label map cannot be read or has the wrong shape or type."""


class InvalidResult(PscoverError, ValueError):
    """A result file cannot be read, or belongs to another instance."""


class InvalidSettings(PscoverError, ValueError):
    """A setting or option is outside its domain."""


class Refused(PscoverError):
    """A backend or formulation cannot take this problem; the message is its one-sentence reason."""


class EngineFailed(PscoverError):
    """An engine crashed or answered with something that is no answer."""


class MissingDependency(PscoverError, ImportError):
    """An optional package is not installed; the message has the pip line."""

    @classmethod
    def for_extra(cls, user: str, packages: Iterable[str], extra: str) -> MissingDependency:
        """The message for something called `user` that needs `packages`; they come with `extra`, or, if that is "", by name.

        Examples
        --------
        >>> print(MissingDependency.for_extra("backend 'scip'", ["pyscipopt"], "scip"))
        backend 'scip' needs the package pyscipopt: pip install "pscover[scip]"
        """
        packages = list(packages)
        names = ", ".join(packages)
        line = f'pip install "pscover[{extra}]"' if extra else f"pip install {' '.join(packages)}"
        return cls(f"{user} needs the package {names}: {line}")


class UnknownName(PscoverError, LookupError):
    """A name is not registered; the message suggests the nearest and lists those known."""

    @classmethod
    def among(cls, kind: str, name: str, known: Iterable[str]) -> UnknownName:
        """The message for `name`, asked for as a `kind`.

        Examples
        --------
        >>> print(UnknownName.among("backend", "higs", ["greedy", "highs"]))
        unknown backend 'higs'; did you mean 'highs'? Known: greedy, highs
        """
        names = sorted(known)
        near = difflib.get_close_matches(name, names, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else "."
        return cls(f"unknown {kind} {name!r}{hint} Known: {', '.join(names) or 'none'}")

"""Names to things: a module in the right folder is registered by lying there; outsiders register by entry point.

A plug-in module `pscover/<kind>/<name>.py` has one module-level name for its class: `formulation`, `backend`, `segmenter` or
`policy`. Names treat `-` and `_` alike. Nothing is imported until it is asked for.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, cast

import msgspec

from pscover.backend import Backend
from pscover.errors import InvalidSettings, MissingDependency, PscoverError, UnknownName
from pscover.formulation import Formulation

if TYPE_CHECKING:
    from pscover.policy import Policy

PACKAGES = {
    "formulation": "pscover.formulations",
    "backend": "pscover.backends",
    "segmenter": "pscover.perception.segmenters",
    "policy": "pscover.policies",
}


@cache
def _modules(kind: str) -> tuple[str, ...]:
    package = PACKAGES[kind]
    try:
        found = importlib.import_module(package)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise PscoverError(
            f"{package} is not importable: this looks like a bare checkout; run `pip install -e .` in the repository"
        ) from None
    return tuple(sorted(m.name for m in pkgutil.iter_modules(found.__path__) if not m.name.startswith("_")))


@cache
def _outside(kind: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for entry in entry_points(group=PACKAGES[kind]):
        name = _module_name(entry.name)
        if name in _modules(kind) or name in found:
            raise PscoverError(f"entry point {entry.name!r} ({entry.value}): a {kind} of that name exists already")
        found[name] = entry
    return found


def _module_name(name: str) -> str:
    return name.replace("-", "_").lower()


def names(kind: str) -> tuple[str, ...]:
    """The names registered for a kind ("formulation", "backend", "segmenter" or "policy"), sorted.

    Examples
    --------
    >>> "clique" in names("formulation"), "highs" in names("backend")
    (True, True)
    """
    return tuple(sorted(_class(kind, name).name for name in (*_modules(kind), *_outside(kind))))


def planning_backend() -> str:
    """The engine that plans unless another is named: `auto`, or `highs` where Numba is not installed.

    Examples
    --------
    >>> planning_backend() in ("auto", "highs")
    True
    """
    return "auto" if importlib.util.find_spec("numba") else "highs"


@cache
def _class(kind: str, module: str) -> Any:
    place = f"{PACKAGES[kind]}.{module}" if module in _modules(kind) else _outside(kind)[module].value
    try:
        found = importlib.import_module(place) if module in _modules(kind) else _outside(kind)[module].load()
    except PscoverError:
        raise
    except Exception as error:
        # A plug-in is somebody's own code, which may raise anything.
        raise PscoverError(f"{kind} {place}: cannot be imported: {type(error).__name__}: {error}") from error
    if module not in _modules(kind):
        return found
    if not hasattr(found, kind):
        raise PscoverError(f"{found.__file__}: expected a {kind}; name its class at the end of the file: {kind} = ...")
    return getattr(found, kind)


def lookup(kind: str, name: str) -> Any:
    """The class registered under a name.

    Raises
    ------
    UnknownName
        With the nearest name and all known ones.
    """
    module = _module_name(name)
    if module not in _modules(kind) and module not in _outside(kind):
        raise UnknownName.among(kind, name, names(kind))
    return _class(kind, module)


def make(kind: str, name: str, options: dict[str, Any] | None = None) -> Any:
    """The thing registered under a name, with its parameters; text is converted to the parameter's type, lists from JSON.

    Raises
    ------
    UnknownName, InvalidSettings
        For an unknown name; for an unknown parameter or a value that does not fit.
    """
    found = lookup(kind, name)
    known = [f.name for f in fields(found)]
    for option in options or {}:
        if option not in known:
            raise UnknownName.among(f"parameter of {kind} {found.name!r}", option, known)
    try:
        return msgspec.convert({k: _parsed(v) for k, v in (options or {}).items()}, type=found, strict=False)
    except msgspec.ValidationError as error:
        raise InvalidSettings(f"{kind} {found.name!r}: {error}") from None


def _parsed(value: Any) -> Any:
    """Text that is a list in JSON as that list; anything else as it is."""
    if not (isinstance(value, str) and value.startswith("[")):
        return value
    try:
        return msgspec.json.decode(value)
    except msgspec.DecodeError:
        return value


def formulation(name: str, options: dict[str, Any] | None = None) -> Formulation:
    """The formulation of that name, with parameters.

    Examples
    --------
    >>> formulation("budgeted", {"budget": "3"}).budget
    3.0
    """
    return cast(Formulation, make("formulation", name, options))


def policy(name: str, options: dict[str, Any] | None = None) -> Policy:
    """The policy of that name, with settings; those of its parts go by their own names.

    Examples
    --------
    >>> found = policy("hybrid-height", {"pile_metres": "0.05", "points": "7"})
    >>> found.pile_metres, found.cycle.points
    (0.05, 7)
    """
    found = lookup("policy", name)
    parts = _parts(found)
    own: dict[str, Any] = {}
    inner: dict[str, dict[str, Any]] = {}
    for option, value in (options or {}).items():
        if option not in policy_settings(name):
            raise UnknownName.among(f"setting of policy {found.name!r}", option, policy_settings(name))
        part = next((part for part, default in parts.items() if option in [f.name for f in fields(default)]), None)
        if part is None or option in parts:
            own[option] = value
        else:
            inner.setdefault(part, {})[option] = _parsed(value)
    # A part that is given in part keeps the policy's own defaults for the rest.
    made = {part: {f.name: getattr(parts[part], f.name) for f in fields(parts[part])} | inner[part] for part in inner}
    return cast("Policy", make("policy", name, {**own, **made}))


def policy_settings(name: str) -> tuple[str, ...]:
    """The names of a policy's settings and of those of its parts.

    Examples
    --------
    >>> policy_settings("height")
    ('radius_cm',)
    """
    found = lookup("policy", name)
    parts = _parts(found)
    own = [f.name for f in fields(found) if f.name not in parts]
    return (*own, *(f.name for part in parts.values() for f in fields(part)))


def _parts(found: Any) -> dict[str, Any]:
    """The settings of a policy that have settings of their own, with their defaults."""
    return {f.name: f.default for f in fields(found) if is_dataclass(f.default)}


def missing(backend_class: Any) -> tuple[str, ...]:
    """The packages that a backend needs and that are not installed; nothing is imported."""
    return tuple(package for package in backend_class.requires if importlib.util.find_spec(package) is None)


def backend(name: str, options: dict[str, Any] | None = None) -> Backend:
    """The backend of that name, with parameters.

    Raises
    ------
    UnknownName, InvalidSettings
        As `make`.
    MissingDependency
        With the pip line, if its packages are not installed.
    """
    found = lookup("backend", name)
    absent = missing(found)
    if absent:
        raise MissingDependency.for_extra(f"backend {found.name!r}", absent, found.extra)
    return cast(Backend, make("backend", name, options))

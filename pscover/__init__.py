"""Plan how a robot clears scattered garments with few trips, as probabilistic set cover, and prove how good the plan is.

>>> import pscover
>>> instance = pscover.Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7)
>>> pscover.solve(instance, backend="greedy").objective
1.0
"""

import sys
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pscover.errors import (
        EngineFailed,
        InvalidImage,
        InvalidInstance,
        InvalidResult,
        InvalidSettings,
        MissingDependency,
        PscoverError,
        Refused,
        UnknownName,
    )
    from pscover.instance import Instance, Meta
    from pscover.isolate import warm_up
    from pscover.planning import Plan, plan
    from pscover.result import Progress, Result, Settings, Status, Stop
    from pscover.scene import Scene
    from pscover.solve import solve
    from pscover.verify import verify

__version__ = "0.1.0"

__all__ = [
    "EngineFailed",
    "Instance",
    "InvalidImage",
    "InvalidInstance",
    "InvalidResult",
    "InvalidSettings",
    "Meta",
    "MissingDependency",
    "Plan",
    "Progress",
    "PscoverError",
    "Refused",
    "Result",
    "Scene",
    "Settings",
    "Status",
    "Stop",
    "UnknownName",
    "plan",
    "solve",
    "verify",
    "warm_up",
]

_HOMES = {
    **dict.fromkeys(("EngineFailed", "InvalidImage", "InvalidInstance", "InvalidResult", "InvalidSettings"), "errors"),
    **dict.fromkeys(("MissingDependency", "PscoverError", "Refused", "UnknownName"), "errors"),
    **dict.fromkeys(("Instance", "Meta"), "instance"),
    **dict.fromkeys(("Plan", "plan"), "planning"),
    **dict.fromkeys(("Progress", "Result", "Settings", "Status", "Stop"), "result"),
    "Scene": "scene",
    "solve": "solve",
    "verify": "verify",
    "warm_up": "isolate",
}


class _Package(ModuleType):
    """The package: what is in it is imported when it is first asked for, so that `pscover --help` waits for no SciPy."""

    def __getattr__(self, name: str) -> Any:
        if name in _HOMES:
            found = getattr(import_module(f"pscover.{_HOMES[name]}"), name)
        elif not name.startswith("_") and find_spec(f"pscover.{name}"):
            found = import_module(f"pscover.{name}")
        else:
            raise AttributeError(f"module 'pscover' has no attribute {name!r}")
        setattr(self, name, found)
        return found

    def __setattr__(self, name: str, value: object) -> None:
        # Python puts every imported module into its package: `solve` and `verify` stay the functions.
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *_HOMES})


sys.modules[__name__].__class__ = _Package

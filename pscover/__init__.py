"""Plan how a robot clears scattered garments with few trips, as probabilistic set cover, and prove how good the plan is.

>>> import pscover
>>> instance = pscover.Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7)
>>> pscover.solve(instance, backend="greedy").objective
1.0
"""

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

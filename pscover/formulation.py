"""The contract of a formulation: a file in `formulations/` that turns an instance into a model."""

from __future__ import annotations

from enum import StrEnum
from typing import ClassVar, Protocol

from pscover.goal import Goal
from pscover.instance import Instance
from pscover.model import Model


class Relation(StrEnum):
    """How the model's feasible plans and objective stand to those of the formulation's goal."""

    EXACT = "exact"
    """The same plans, the same objective: a bound is a bound, infeasible is infeasible."""
    RELAXATION = "relaxation"
    """At least the goal's plans, an objective that is never higher: bounds hold, plans must be checked."""
    RESTRICTION = "restriction"
    """Only some of the goal's plans: plans hold, bounds and infeasibility do not."""


class Formulation(Protocol):
    """A way to write an instance as a mixed-integer linear model.

    Implementations are frozen dataclasses whose fields are their parameters, each with a default.

    Attributes
    ----------
    name
        As used on the command line; the file's name.
    relation
        To the goal, see `Relation`.
    tolerance
        By how much the model's objective may differ from the goal's (0 for exact formulations).
    goal
        What the plan is for.
    """

    name: ClassVar[str]

    @property
    def relation(self) -> Relation:
        """To the goal."""
        ...

    @property
    def tolerance(self) -> float:
        """Largest difference between the model's objective and the goal's."""
        ...

    @property
    def goal(self) -> Goal:
        """What the plan is for."""
        ...

    def build(self, instance: Instance) -> Model:
        """The model, whose first `instance.candidates` variables are the candidates.

        Raises
        ------
        Refused
            If the instance cannot be written this way; the message is the reason in one sentence.
        """
        ...

"""The contract of a backend: a file in `pscover/backends/` that solves models."""

from __future__ import annotations

from typing import ClassVar, Protocol, runtime_checkable

from pscover.model import Model
from pscover.result import Answer, Observer, Settings


class Backend(Protocol):
    """An engine. Implementations are frozen dataclasses whose fields are their parameters, each with a default.

    Attributes
    ----------
    name
        As used on the command line; the file's name with hyphens.
    exact
        Whether it proves optimality, given time.
    isolated
        Whether it must run in a process of its own, so that a deadline or Ctrl-C can end it. False only for engines
        that look at the clock and at the observer themselves; under a deadline, large models go to a process all the same.
    requires
        Importable names of the optional packages it needs.
    extra
        The extra of pscover that brings them, or "".
    """

    name: ClassVar[str]
    exact: ClassVar[bool]
    isolated: ClassVar[bool]
    requires: ClassVar[tuple[str, ...]]
    extra: ClassVar[str]

    def refuses(self, model: Model) -> str | None:
        """One sentence why this model cannot be taken, or None."""
        ...

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Solve the model (one objective: `model.then` is empty), calling `observe` at each improvement.

        `settings.time` is what is left of the deadline; `settings.start` are candidate indices. `Progress.objective` and
        `.bound` include `model.offset`. When `observe` returns True, stop with the best plan so far.
        """
        ...


@runtime_checkable
class SlowToStart(Protocol):
    """What a backend may have besides: something to load before its first solve."""

    def warm_up(self) -> None:
        """Begin to load it in the background, and return at once."""
        ...

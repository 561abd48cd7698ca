"""Engines that misbehave, for the tests of isolation; imported by worker processes from here."""

from __future__ import annotations

import math
import os
import sys
import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pscover.errors import Refused
from pscover.model import Model
from pscover.result import Answer, Observer, Progress, Settings, Status


@dataclass(frozen=True, slots=True)
class Misbehaving:
    """Reports the plans in `plans`, one every `pause` seconds, then does what `then` says."""

    plans: tuple[tuple[int, ...], ...] = ()
    pause: float = 0.0
    then: str = "answer"
    bound: float = -math.inf
    status: Status = Status.FEASIBLE

    name: ClassVar[str] = "misbehaving"
    exact: ClassVar[bool] = True
    isolated: ClassVar[bool] = True
    requires: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    def refuses(self, model: Model) -> str | None:
        return "it never takes anything" if self.then == "refuse" else None

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        began = time.monotonic()
        best = None
        for plan in self.plans:
            time.sleep(self.pause)
            best = np.array(plan, dtype=np.int32)
            objective = float(model.c[best].sum())
            halted = observe(Progress(seconds=time.monotonic() - began, objective=objective, bound=self.bound, chosen=best))
            if halted and self.then != "ignore everything":
                return Answer(status=Status.FEASIBLE, chosen=best, bound=self.bound)
        if self.then in ("sleep", "ignore everything"):
            time.sleep(60)
        if self.then == "die":
            os._exit(7)
        if self.then == "raise":
            raise RuntimeError("wires crossed")
        if self.then == "refuse late":
            raise Refused("on second thoughts, no")
        if self.then == "chatter":
            os.write(1, b"noise\n" * 1000)
            sys.stdout.write("more noise\n")
        return Answer(status=self.status, chosen=best, bound=self.bound)


@dataclass(frozen=True, slots=True)
class Inline(Misbehaving):
    """The same, in the caller's process."""

    isolated: ClassVar[bool] = False

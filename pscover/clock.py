"""A deadline that starts when it is made and is passed along."""

from __future__ import annotations

import math
import time


class Clock:
    """Wall time since creation, against a budget of seconds.

    Parameters
    ----------
    seconds
        The budget; infinite by default.
    """

    __slots__ = ("began", "seconds")

    def __init__(self, seconds: float = math.inf) -> None:
        self.began = time.monotonic()
        self.seconds = seconds

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self.began

    @property
    def left(self) -> float:
        """Seconds until the deadline, negative after it."""
        return self.seconds - self.elapsed

    @property
    def is_over(self) -> bool:
        """Whether the deadline has passed."""
        return self.left <= 0

"""Another engine on the same problem in a process of its own, while this one gets ready or works on."""

from __future__ import annotations

import queue
import threading

from pscover import isolate, registry
from pscover.clock import Clock
from pscover.model import Model
from pscover.result import Answer, Progress, Settings


class Beside:
    """HiGHS on a model; what it finds waits to be asked for.

    Parameters
    ----------
    model
        What to solve.
    settings
        How; its time is the deadline.
    """

    def __init__(self, model: Model, settings: Settings) -> None:
        self.answer: Answer | None = None
        self._news: queue.SimpleQueue[Progress] = queue.SimpleQueue()
        self._is_dismissed = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(model, settings), daemon=True)
        self._thread.start()

    @property
    def is_done(self) -> bool:
        """Whether no more news will come."""
        return not self._thread.is_alive()

    def news(self) -> list[Progress]:
        """What was found since the last call."""
        found = []
        while not self._news.empty():
            found.append(self._news.get())
        return found

    def wait(self, seconds: float) -> None:
        """Wait for it to end, at most so long."""
        self._thread.join(seconds)

    def dismiss(self) -> None:
        """It is no longer needed; it ends at its next find, or at its deadline."""
        self._is_dismissed.set()

    def _run(self, model: Model, settings: Settings) -> None:
        def seen(progress: Progress) -> bool:
            self._news.put(progress)
            return self._is_dismissed.is_set()

        try:
            self.answer = isolate.run(registry.backend("highs"), model, settings, seen, Clock(settings.time))
        except Exception:
            # It only helps: what it cannot do the caller does without it.
            self.answer = None

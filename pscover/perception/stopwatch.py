"""Wall and CPU seconds of named stages that come and go in any order."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from pscover.perception.segmenter import Stage


class Stopwatch:
    """Adds up the time of stages; a stage that is entered again goes on.

    Examples
    --------
    >>> watch = Stopwatch()
    >>> for name in ("decoder", "post-processing", "decoder"):
    ...     with watch.stage(name):
    ...         pass
    >>> [stage.name for stage in watch.stages]
    ['decoder', 'post-processing']
    """

    def __init__(self) -> None:
        self._seconds: dict[str, tuple[float, float]] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time what happens inside."""
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            before = self._seconds.get(name, (0.0, 0.0))
            self._seconds[name] = (before[0] + time.perf_counter() - wall, before[1] + time.process_time() - cpu)

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages so far, in the order in which they were first entered."""
        return tuple(Stage(name=name, seconds=wall, cpu_seconds=cpu) for name, (wall, cpu) in self._seconds.items())

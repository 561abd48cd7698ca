"""Two Dask workers, one of which is killed, for the tests of what is computed on a cluster."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any

import pytest

LONG = 300.0
"""Seconds without a result after which workers that live are given up: starting them takes long where much else runs."""


@dataclass(slots=True, kw_only=True)
class Workers:
    """The workers, and which of them is dead.

    Parameters
    ----------
    cluster
        Of Dask.
    killed
        Its process, once there is one.
    """

    cluster: Any
    killed: list[int] = field(default_factory=list)

    @property
    def address(self) -> str:
        """Of their scheduler."""
        return str(self.cluster.scheduler_address)

    def kill_one(self) -> None:
        """Kill the first, unless that has been done."""
        if not self.killed:
            self.killed.append(next(iter(self.cluster.workers.values())).process.process.pid)
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.killed[0], signal.SIGKILL)

    def finish(self, everything: Callable[[Callable[[], None]], None]) -> None:
        """Run something that calls what it is given after each result, and kills; fail where it would wait for ever."""
        signs: SimpleQueue[bool] = SimpleQueue()

        def run() -> None:
            try:
                everything(lambda: signs.put(True))
            finally:
                signs.put(False)

        threading.Thread(target=run, daemon=True).start()
        goes_on, last = True, time.monotonic()
        while goes_on:
            try:
                goes_on, last = signs.get(timeout=1.0), time.monotonic()
            except Empty:
                assert self.cluster.scheduler.workers, "no worker is left"
                assert time.monotonic() - last < LONG, "no result for long"


@contextmanager
def two_workers() -> Iterator[Workers]:
    """A cluster; whoever asks for it kills one of them."""
    pytest.importorskip("distributed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from distributed import LocalCluster

        cluster = LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50)
    workers = Workers(cluster=cluster)
    try:
        yield workers
        assert workers.killed
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            cluster.close(timeout=10)

"""Where the cases of a sweep run: the options, and what they stand for."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pscover.cli.options import together

if TYPE_CHECKING:
    from concurrent.futures import Executor

Command = TypeVar("Command", bound=Callable[..., Any])


def worker_options(command: Command) -> Command:
    """--jobs and --scheduler."""
    return together(
        (
            click.option("--jobs", "-j", type=click.IntRange(1, 256), default=1, show_default=True, help="Processes."),
            click.option("--scheduler", metavar="ADDRESS", help="Run on the workers of a Dask scheduler instead."),
        )
    )(command)


def workers(jobs: int, scheduler: str | None) -> Callable[[], AbstractContextManager[Executor]]:
    """Makes an executor of them, as often as is asked."""
    from pscover.evidence import executors

    return lambda: executors.cluster(scheduler) if scheduler else executors.processes(jobs)

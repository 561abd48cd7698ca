"""Options of the test run."""

from __future__ import annotations

import signal
import threading

import pytest
from hypothesis import settings

# The same examples at every run, so that a red run is red again; --hypothesis-profile=default draws new ones.
settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--instances", type=int, default=24, help="random instances for each cell of the matrix of formulations and backends"
    )


def pytest_configure(config: pytest.Config) -> None:
    # In the background of a shell SIGINT is ignored, and so it would be in every process that a test starts and interrupts.
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)

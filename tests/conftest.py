"""Options of the test run."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--instances", type=int, default=24, help="random instances for each cell of the matrix of formulations and backends"
    )

"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])
FILE = click.Path(path_type=Path)


class Assignment(click.ParamType):
    """A parameter and its value, written NAME=VALUE."""

    name = "NAME=VALUE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, str]:
        """Split at the first equals sign."""
        if isinstance(value, tuple):
            return value
        name, sign, content = str(value).partition("=")
        if not sign or not name.strip():
            self.fail(f"expected NAME=VALUE, got {value!r}", param, ctx)
        return name.strip(), content.strip()


class Numbers(click.ParamType):
    """Whole numbers with commas between them."""

    name = "N,N,..."

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, ...]:
        """Split at commas."""
        if isinstance(value, tuple):
            return value
        try:
            return tuple(int(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"expected whole numbers with commas between them, got {value!r}", param, ctx)


class Point(click.ParamType):
    """A place in the image, written X,Y."""

    name = "X,Y"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, float]:
        """Two numbers with a comma between them."""
        if isinstance(value, tuple):
            return value
        try:
            x, y = (float(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"expected two numbers with a comma between them, got {value!r}", param, ctx)
        return x, y


class Names(click.ParamType):
    """Names with commas between them."""

    name = "A,B,..."

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:
        """Split at commas; nothing between two of them is nothing."""
        if isinstance(value, tuple):
            return value
        found = tuple(part.strip() for part in str(value).split(",") if part.strip())
        if not found:
            self.fail("expected at least one name", param, ctx)
        return found


def together(options: Iterable[Callable[[Command], Command]]) -> Callable[[Command], Command]:
    """Several options as one decorator, shown in the given order."""
    listed = list(options)

    def decorate(command: Command) -> Command:
        for option in reversed(listed):
            command = option(command)
        return command

    return decorate


def settings_options(seconds: float) -> Callable[[Command], Command]:
    """The fields of `Settings` as options; `seconds` is the default time limit."""
    return together(
        (
            click.option("--time", type=float, default=seconds, show_default=True, metavar="SECONDS", help="Deadline."),
            click.option("--gap", type=float, default=0.0, show_default=True, help="Relative gap at which to stop."),
            click.option("--threads", type=int, default=1, show_default=True, help="For engines that can use several."),
            click.option("--seed", type=int, default=0, show_default=True, help="Of everything random."),
            click.option(
                "--margin", type=float, default=0.0, show_default=True, help="Added to every positive requirement."
            ),
        )
    )


def json_option(command: Command) -> Command:
    """--json: the content as one JSON document."""
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of tables.")(command)


def quiet_option(command: Command) -> Command:
    """--quiet: no live line and no notes."""
    return click.option("--quiet", "-q", is_flag=True, help="No live line and no notes on standard error.")(command)


def backend_option(command: Command) -> Command:
    """--backend: a name, checked when it is used."""
    return click.option(
        "--backend", "-b", default="highs", show_default=True, metavar="NAME", help="Engine; see `pscover backends`."
    )(command)

"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])
FILE = click.Path(path_type=Path)


def assignment(text: Any) -> tuple[str, str]:
    """A parameter and its value, written NAME=VALUE."""
    if isinstance(text, tuple):
        return text
    name, sign, content = str(text).partition("=")
    if not sign or not name.strip():
        raise click.BadParameter(f"expected NAME=VALUE, got {text!r}")
    return name.strip(), content.strip()


def whole_numbers(text: Any) -> tuple[int, ...]:
    """Whole numbers with commas between them."""
    if isinstance(text, tuple):
        return text
    try:
        return tuple(int(part) for part in str(text).split(","))
    except ValueError:
        raise click.BadParameter(f"expected whole numbers with commas between them, got {text!r}") from None


def point(text: Any) -> tuple[float, float]:
    """A place in the image, written X,Y."""
    if isinstance(text, tuple):
        return text
    try:
        x, y = (float(part) for part in str(text).split(","))
    except ValueError:
        raise click.BadParameter(f"expected two numbers with a comma between them, got {text!r}") from None
    return x, y


def names(text: Any) -> tuple[str, ...]:
    """Names with commas between them; nothing between two of them is nothing."""
    if isinstance(text, tuple):
        return text
    found = tuple(part.strip() for part in str(text).split(",") if part.strip())
    if not found:
        raise click.BadParameter("expected at least one name")
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


def known(kind: str) -> Callable[[click.Context, click.Parameter, str], list[str]]:
    """Completes the registered names of a kind in a shell."""

    def completed(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
        from pscover import registry

        return [name for name in registry.names(kind) if name.startswith(incomplete)]

    return completed


def parameter_option(flag: str, target: str, owner: str) -> Callable[[Command], Command]:
    """A repeatable option NAME=VALUE that sets a parameter of `owner`."""
    text = f"A parameter of the {owner}; repeatable."
    return click.option(flag, target, type=assignment, metavar="NAME=VALUE", multiple=True, help=text)


def backend_option(command: Command) -> Command:
    """--backend: a name, checked when it is used."""
    text = "Engine; see `pscover backends`."
    return click.option(
        *("--backend", "-b"),
        default="highs",
        show_default=True,
        metavar="NAME",
        help=text,
        shell_complete=known("backend"),
    )(command)


def planning_backend_option(command: Command) -> Command:
    """--backend, for commands that plan: by default None, which is for `plan` to decide."""
    text = "Engine; see `pscover backends`.  [default: auto, or highs without Numba]"
    return click.option("--backend", "-b", metavar="NAME", help=text, shell_complete=known("backend"))(command)


def formulation_option(command: Command) -> Command:
    """--formulation: a name, checked when it is used."""
    text = "Model; see `pscover formulations`."
    return click.option(
        *("--formulation", "-f"),
        default="clique",
        show_default=True,
        metavar="NAME",
        help=text,
        shell_complete=known("formulation"),
    )(command)

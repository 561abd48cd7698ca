"""How a command ends: exit codes, and every error as one line on standard error."""

from __future__ import annotations

import errno
import io
import os
import sys
import traceback
from enum import IntEnum

import click

from pscover.errors import EngineFailed, MissingDependency, PscoverError

ISSUES = "please report this line, and what PSCOVER_DEBUG=1 shows"


class Exit(IntEnum):
    """The exit codes of `pscover`; `pscover --help` lists them."""

    VERIFIED = 0
    NO_PLAN = 1
    BAD_INPUT = 2
    MISSING = 3
    BUG = 70
    INTERRUPTED = 130
    READER_GONE = 141


MEANING = {
    Exit.VERIFIED: "a verified plan (also when the time limit or Ctrl-C ended the search); for other commands: done",
    Exit.NO_PLAN: "no plan: proven infeasible, none found in time, an engine broke down, or the check failed",
    Exit.BAD_INPUT: "bad usage, an input that cannot be read or taken, or an output that cannot be written",
    Exit.MISSING: "an optional package is missing; the message has the pip line",
    Exit.BUG: "a bug in pscover; PSCOVER_DEBUG=1 shows the traceback",
    Exit.INTERRUPTED: "Ctrl-C before there was a plan",
    Exit.READER_GONE: "whoever read standard output went away",
}


def is_debugging() -> bool:
    """Whether PSCOVER_DEBUG asks for tracebacks."""
    return os.environ.get("PSCOVER_DEBUG", "") not in ("", "0")


def say(text: str) -> None:
    """One line on standard error, after the program's name; line breaks within it become spaces."""
    click.echo(f"pscover: {' '.join(text.split())}", err=True)


def report(error: BaseException) -> Exit:
    """Say what went wrong, in one line, and return the exit code that goes with it."""
    if is_debugging() and not isinstance(error, click.ClickException | KeyboardInterrupt):
        click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    match error:
        case KeyboardInterrupt() | click.Abort():
            return leave_interrupted()
        case BrokenPipeError():
            return leave_unread()
        case click.UsageError():
            return _misused(error)
        case _:
            code, message = explained(error)
            say(f"error: {message}")
            return code


def explained(error: BaseException) -> tuple[Exit, str]:
    """The exit code of an error, and what to say of it."""
    match error:
        case MissingDependency():
            return Exit.MISSING, str(error)
        case PscoverError():
            return Exit.NO_PLAN if isinstance(error, EngineFailed) else Exit.BAD_INPUT, str(error)
        case click.ClickException():
            return Exit.BAD_INPUT, error.format_message()
        case MemoryError():
            return Exit.BAD_INPUT, "there is not enough memory for this problem"
        case OSError() if error.filename is not None:
            return Exit.BAD_INPUT, f"{error.filename}: {error.strerror}"
        case OSError() if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EIO):
            # Output files have names: this is what the shell made of standard output.
            return Exit.BAD_INPUT, f"standard output: {error.strerror}"
        case _:
            return Exit.BUG, f"{type(error).__name__}: {error} (this is a bug: {ISSUES})"


def leave_interrupted() -> Exit:
    """Say that Ctrl-C came before there was anything to show."""
    # A terminal shows ^C without a line break.
    if sys.stderr.isatty():
        click.echo(err=True)
    say("interrupted before there was anything to show")
    return Exit.INTERRUPTED


def leave_unread() -> Exit:
    """Let nothing more be written to a standard output that nobody reads."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, ValueError):
        sys.stdout = io.StringIO()
    return Exit.READER_GONE


def _misused(error: click.UsageError) -> Exit:
    if error.ctx is not None and error.format_message() == error.ctx.get_help():
        # A group without a subcommand: nothing is wrong but that the help is needed.
        click.echo(error.ctx.get_help(), err=True)
        return Exit.BAD_INPUT
    # Click ends some of its messages with a full stop and some not; its suggestions follow in the same text.
    say(f"error: {error.format_message()}")
    if error.ctx is not None:
        click.echo(f"Try '{error.ctx.command_path} --help'.", err=True)
    return Exit.BAD_INPUT

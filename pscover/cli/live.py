"""The live line: what is known while an engine works, on a standard error that is a terminal."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pscover.cli.words import number, percent

if TYPE_CHECKING:
    from rich.text import Text

    from pscover.result import Progress

FRAMES_A_SECOND = 8.0


@dataclass
class Line:
    """An observer that remembers the last it heard, and renders it.

    Parameters
    ----------
    label
        What is being worked on.
    """

    label: str
    began: float = field(default_factory=time.monotonic)
    objective: float = math.inf
    bound: float = -math.inf

    def restart(self, label: str) -> None:
        """Begin with another piece of work."""
        self.label, self.began, self.objective, self.bound = label, time.monotonic(), math.inf, -math.inf

    def __call__(self, progress: Progress) -> bool:
        """Take note of an improvement; never asks to stop."""
        self.objective, self.bound = progress.objective, progress.bound
        return False

    def __str__(self) -> str:
        from pscover.result import relative_gap

        parts = [f"{time.monotonic() - self.began:.1f} s"]
        if math.isfinite(self.objective):
            parts.append(f"best {number(self.objective)}")
        if math.isfinite(self.bound):
            parts.append(f"bound {number(self.bound)}")
        if math.isfinite(gap := relative_gap(self.objective, self.bound)):
            parts.append(f"gap {percent(gap)}")
        return "  ".join([self.label, *parts, "Ctrl-C stops"])

    def __rich__(self) -> Text:
        from rich.text import Text

        return Text(str(self), no_wrap=True, overflow="ellipsis", style="dim")


@contextmanager
def watching(label: str, *, quiet: bool) -> Iterator[Line]:
    """Show the line while the block runs, unless standard error is no terminal or it is to be quiet."""
    line = Line(label)
    if quiet or not sys.stderr.isatty():
        yield line
        return
    from rich.live import Live

    from pscover.cli.output import aside

    with Live(line, console=aside(), transient=True, refresh_per_second=FRAMES_A_SECOND):
        yield line


@contextmanager
def advancing(total: int, *, quiet: bool) -> Iterator[Callable[[str], None]]:
    """A bar of so many steps on a standard error that is a terminal; each call is a step, and says what it was."""
    if quiet or not sys.stderr.isatty():
        yield lambda what: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from pscover.cli.output import aside

    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=aside(), transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda what: bar.update(task, advance=1, description=what)

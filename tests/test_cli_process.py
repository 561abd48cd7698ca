"""The program as a process: Ctrl-C, closed pipes, terminals and their widths."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from pscover import Instance
from pscover.cli.fail import Exit
from pscover.generate.psc import random_psc
from pscover.io import save_instance

PROGRAM = [sys.executable, "-m", "pscover"]
posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals and terminals")


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.json"
    save_instance(Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7), path)
    return path


@pytest.fixture
def hard(tmp_path: Path) -> Path:
    path = tmp_path / "hard.npz"
    save_instance(random_psc(150, 900, clique_size=6, required=0.95, seed=2), path)
    return path


@contextmanager
def terminal() -> Iterator[tuple[int, int]]:
    """Both ends of a terminal of 80 columns."""
    import fcntl
    import pty
    import struct
    import termios

    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    try:
        yield master, slave
    finally:
        os.close(master)


def environment(**extra: str) -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "NO_COLOR", "FORCE_COLOR", "PSCOVER_DEBUG")}
    return {**kept, "TERM": "xterm-256color", **extra}


def drained(master: int) -> str:
    """All that is written to a terminal until its last writer is gone."""
    content = b""
    while True:
        try:
            part = os.read(master, 65536)
        except OSError:
            break
        if not part:
            break
        content += part
    return content.decode()


def test_python_m(small: Path) -> None:
    ended = subprocess.run([*PROGRAM, "solve", str(small)], capture_output=True, text=True, env=environment())
    assert ended.returncode == Exit.VERIFIED
    assert "\x1b" not in ended.stdout + ended.stderr
    assert ended.stderr == ""
    assert max(map(len, ended.stdout.splitlines())) <= 80


def test_an_encoding_that_lacks_the_signs(small: Path) -> None:
    ended = subprocess.run(
        [*PROGRAM, "compare", str(small), "-b", "greedy"],
        capture_output=True,
        env=environment(PYTHONIOENCODING="ascii"),
    )
    assert ended.returncode == Exit.VERIFIED
    assert ended.stdout.isascii()
    assert b"Traceback" not in ended.stderr


@posix
@pytest.mark.parametrize(
    ("redirected", "code"),
    [
        (">&-", Exit.VERIFIED),
        ("2>&- >/dev/null", Exit.VERIFIED),
        ("<&- >&- 2>&-", Exit.VERIFIED),
        ("> /dev/full", Exit.BAD_INPUT),
    ],
)
def test_streams_that_are_closed_or_full(small: Path, redirected: str, code: Exit) -> None:
    if "/dev/full" in redirected and not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full")
    shell = f'"$@" {redirected}'
    ended = subprocess.run(
        ["sh", "-c", shell, "sh", *PROGRAM, "solve", str(small), "-q"], capture_output=True, text=True, env=environment()
    )
    assert ended.returncode == code
    assert "bug" not in ended.stderr
    assert len(ended.stderr.splitlines()) == (code is Exit.BAD_INPUT)


@posix
def test_ctrl_c_prints_the_best_plan_so_far(hard: Path) -> None:
    with terminal() as (master, slave):
        process = subprocess.Popen(
            [*PROGRAM, "solve", str(hard), "--backend", "highs", "--time", "120"],
            stdout=subprocess.PIPE,
            stderr=slave,
            text=True,
            env=environment(),
        )
        os.close(slave)
        seen = ""
        while "  best " not in seen:
            part = os.read(master, 4096).decode()
            assert part, seen
            seen += part
        rest: list[str] = []
        reader = threading.Thread(target=lambda: rest.append(drained(master)))
        reader.start()
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=60)
        reader.join(timeout=10)
    assert process.returncode == Exit.VERIFIED
    assert "interrupted; this is the best so far" in " ".join(output.split())
    assert "verified   yes" in output
    assert "Traceback" not in output + seen + rest[0]


@posix
def test_ctrl_c_before_there_is_a_plan(tmp_path: Path) -> None:
    # The program says nothing before the answer: interrupt it while it sleeps in the place of the reader.
    code = (
        "import os, signal, pscover.io, pscover.cli\n"
        "def load(path):\n    os.kill(os.getpid(), signal.SIGINT)\n"
        "pscover.io.load_instance = load\n"
        "pscover.cli.main(['solve', 'any.json'])"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment())
    assert ended.returncode == Exit.INTERRUPTED
    assert ended.stderr == "pscover: interrupted before there was anything to show\n"
    assert ended.stdout == ""


@posix
@pytest.mark.parametrize(
    "module", ["click", "pscover.cli.app", "pscover.cli.fail", "pscover.cli.info", "pscover.io", "scipy.sparse"]
)
def test_ctrl_c_while_modules_are_loaded(small: Path, module: str) -> None:
    code = (
        "import os, signal, sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {module!r}:\n"
        "            sys.meta_path.remove(self)\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "from pscover.cli import main\n"
        f"main(['info', {str(small)!r}])"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment())
    assert ended.returncode == Exit.INTERRUPTED
    assert ended.stderr == "pscover: interrupted before there was anything to show\n"
    assert ended.stdout == ""


@posix
@pytest.mark.parametrize("command", [["info"], ["info", "--json"], ["solve", "-b", "greedy"], ["compare", "-b", "greedy"]])
def test_a_reader_that_went_away(small: Path, command: list[str]) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        ended = subprocess.run(
            [*PROGRAM, command[0], str(small), *command[1:]],
            stdout=writing,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(),
        )
    finally:
        os.close(writing)
    assert ended.returncode == Exit.READER_GONE
    assert ended.stderr == ""


@posix
def test_help_to_a_reader_that_went_away() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        ended = subprocess.run([*PROGRAM, "--help"], stdout=writing, stderr=subprocess.PIPE, text=True, env=environment())
    finally:
        os.close(writing)
    assert ended.returncode == Exit.READER_GONE
    assert ended.stderr == ""


@posix
@pytest.mark.parametrize("colour", [True, False])
def test_colours_on_a_terminal_unless_not_wanted(small: Path, colour: bool) -> None:
    wanted = {} if colour else {"NO_COLOR": "1"}
    with terminal() as (master, slave):
        process = subprocess.Popen(
            [*PROGRAM, "solve", str(small), "-b", "greedy"],
            stdout=slave,
            stderr=subprocess.DEVNULL,
            env=environment(**wanted),
        )
        os.close(slave)
        content = drained(master)
        assert process.wait(timeout=60) == Exit.VERIFIED
    has_colour = any(f"\x1b[{code}m" in content for code in ("1;32", "1;33", "32", "33"))
    assert has_colour is colour


@posix
def test_json_on_a_terminal_is_plain(small: Path) -> None:
    import json

    with terminal() as (master, slave):
        process = subprocess.Popen(
            [*PROGRAM, "solve", str(small), "-b", "greedy", "--json", "-q"], stdout=slave, stderr=slave, env=environment()
        )
        os.close(slave)
        content = drained(master)
        assert process.wait(timeout=60) == Exit.VERIFIED
    assert json.loads(content)["verification"]["passed"] is True

"""The program as a whole: help, version, names, errors and exit codes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

import pscover
from pscover import EngineFailed, MissingDependency, Refused
from pscover.cli.app import COMMANDS, app
from pscover.cli.fail import MEANING, Exit
from pscover.cli.output import plain, require_distinct, require_writable

PATHS = [[name] for name in COMMANDS] + [["generate", "garments"], ["generate", "psc"], ["formulations", "show"]]
PATHS += [["models", name] for name in ("where", "check", "export")]


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(a) for a in arguments])


def raising(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> Result:
    def fail(path: object) -> None:
        raise error

    monkeypatch.setattr("pscover.io.load_instance", fail)
    return run("info", "any.json")


def test_help_names_every_command_and_exit_code() -> None:
    shown = run("--help")
    assert shown.exit_code == 0
    for name in COMMANDS:
        assert f"\n  {name} " in shown.output
    for code in MEANING:
        assert f"\n  {code.value:>5}  " in shown.output or f"  {code.value}  " in shown.output
    assert "Examples:" in shown.output


def test_every_exit_code_has_a_meaning() -> None:
    assert set(MEANING) == set(Exit)


@pytest.mark.parametrize("path", PATHS, ids=" ".join)
def test_every_command_has_help_within_80_columns(path: list[str]) -> None:
    for flag in ("--help", "-h"):
        shown = CliRunner(env={"COLUMNS": "80"}).invoke(app, [*path, flag])
        assert shown.exit_code == 0
        assert max(len(line) for line in shown.output.splitlines()) <= 80
        assert shown.stderr == ""


def test_version() -> None:
    shown = run("--version")
    assert shown.exit_code == 0
    assert shown.output.strip() == f"pscover, version {pscover.__version__}"


def test_help_imports_no_numbers_no_engine_and_no_tables() -> None:
    heavy = {
        "numpy",
        "scipy",
        "rich",
        "highspy",
        "cv2",
        "matplotlib",
        "cvxpy",
        "pyomo",
        "ortools",
        "pyscipopt",
        "torch",
        "shapely",
    }
    code = (
        "import sys\nfrom pscover.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit as end:\n    assert end.code == 0\n"
        f"print(sorted({heavy!r} & set(sys.modules)), file=sys.stderr)"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stderr.strip() == "[]"


def test_without_a_command_the_help_is_shown() -> None:
    shown = run()
    assert shown.exit_code == 2
    assert "Commands:" in shown.output


def test_an_unknown_command_gets_a_suggestion() -> None:
    shown = run("slove")
    assert shown.exit_code == 2
    assert "did you mean 'solve'?" in shown.stderr
    assert shown.stdout == ""


@pytest.mark.parametrize("arguments", [[], ["generate"]])
def test_a_group_without_a_command_shows_its_help(arguments: list[str]) -> None:
    shown = run(*arguments)
    assert shown.exit_code == Exit.BAD_INPUT
    assert shown.stdout == ""
    assert shown.stderr.startswith("Usage: ")
    assert len(shown.stderr.splitlines()) > 5


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--nonsense"], "--nonsense"),
        (["solve"], "INSTANCE"),
        (["solve", "x.json", "--time", "soon"], "'soon'"),
        (["solve", "x.json", "--time", "0"], "time: expected a positive number"),
        (["solve", "x.json", "--time", "nan"], "time: expected a positive number"),
        (["solve", "x.json", "--threads", "0"], "threads"),
        (["solve", "x.json", "--seed", "-1"], "seed"),
        (["solve", "x.json", "--gap", "-0.1"], "gap"),
        (["solve", "x.json", "--margin", "1"], "margin"),
        (["solve", "x.json", "--set", "budget"], "NAME=VALUE"),
        (["solve", "x.json", "-f", "budgeted", "--set", "budgte=3"], "did you mean 'budget'?"),
        (["solve", "x.json", "-f", "budgeted", "--set", "budget=much"], "budget"),
        (["solve", "x.json", "-b", "higs"], "did you mean 'highs'?"),
        (["solve", "x.json", "-f", "clik"], "did you mean 'clique'?"),
        (["compare", "x.json", "-b", "higs"], "did you mean 'highs'?"),
        (["compare", "x.json", "-b", ","], "at least one name"),
        (["formulations", "show", "clik"], "did you mean 'clique'?"),
        (["plan", "x.png", "--basket", "3"], "two numbers"),
        (["plan", "x.png", "--figure", "a.png", "--no-figure"], "exclude each other"),
        (["generate", "garments", "--groups", "2,b", "-o", "x.png"], "whole numbers"),
        (["generate", "psc", "-o", "x.json"], "--elements"),
    ],
)
def test_bad_usage_is_one_line_and_code_2(arguments: list[str], word: str) -> None:
    shown = run(*arguments)
    assert shown.exit_code == Exit.BAD_INPUT
    line, *rest = shown.stderr.splitlines()
    assert line.startswith("pscover: error: ")
    assert word in line
    assert len(rest) <= 1
    assert shown.stdout == ""


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (EngineFailed("it broke"), Exit.NO_PLAN),
        (Refused("it cannot"), Exit.BAD_INPUT),
        (MissingDependency.for_extra("backend 'scip'", ["pyscipopt"], "scip"), Exit.MISSING),
        (MemoryError(), Exit.BAD_INPUT),
        (PermissionError(13, "Permission denied", "x.json"), Exit.BAD_INPUT),
        (BrokenPipeError(), Exit.READER_GONE),
        (KeyboardInterrupt(), Exit.INTERRUPTED),
        (click.Abort(), Exit.INTERRUPTED),
        (ZeroDivisionError("no such thing"), Exit.BUG),
        (OSError("no file named"), Exit.BUG),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_errors_end_as_one_line(monkeypatch: pytest.MonkeyPatch, error: BaseException, code: Exit) -> None:
    monkeypatch.delenv("PSCOVER_DEBUG", raising=False)
    shown = raising(monkeypatch, error)
    assert shown.exit_code == code
    assert "Traceback" not in shown.output
    assert len(shown.stderr.splitlines()) == (0 if code is Exit.READER_GONE else 1)
    assert ("this is a bug" in shown.stderr) == (code is Exit.BUG)


def test_debugging_shows_the_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSCOVER_DEBUG", "1")
    shown = raising(monkeypatch, ZeroDivisionError("no such thing"))
    assert shown.exit_code == Exit.BUG
    assert "Traceback (most recent call last)" in shown.stderr
    assert "this is a bug" in shown.stderr.splitlines()[-1]


def test_missing_dependency_shows_the_pip_line(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = raising(monkeypatch, MissingDependency.for_extra("backend 'scip'", ["pyscipopt"], "scip"))
    assert 'pip install "pscover[scip]"' in shown.stderr


def test_plain_leaves_nothing_that_json_lacks() -> None:
    given = {"a": float("inf"), "b": [float("nan"), 1], "c": Exit.BUG, "d": Path("x"), "e": {"f": (True, None)}}
    assert plain(given) == {"a": None, "b": [None, 1], "c": 70, "d": "x", "e": {"f": [True, None]}}


def test_outputs_are_looked_at_before_the_work(tmp_path: Path) -> None:
    there = tmp_path / "there.json"
    there.write_text("{}")
    for path, word in (
        (tmp_path, "directory"),
        (tmp_path / "none" / "x.json", "no folder"),
        (tmp_path / "x.txt", "ends in .json"),
        (there / "x.json", "cannot be written"),
        (there, "replace an input"),
        (Path("-"), "standard output"),
    ):
        with pytest.raises(pscover.PscoverError, match=word):
            require_writable(path, [there], suffixes=() if path == tmp_path or str(path) == "-" else (".json",))
    require_writable(tmp_path / "x.json", [there], suffixes=(".json",))
    require_writable(None)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["there.json"]


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="needs a device file")
def test_a_device_is_no_output() -> None:
    with pytest.raises(pscover.PscoverError, match="device"):
        require_writable(Path("/dev/null"))


def test_two_outputs_need_two_files(tmp_path: Path) -> None:
    require_distinct(tmp_path / "a", None, None, tmp_path / "b")
    with pytest.raises(pscover.PscoverError, match="two outputs"):
        require_distinct(tmp_path / "a", tmp_path / "b" / ".." / "a")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("pscover so", "solve"),
        ("pscover solve x.json --backend lp", "lp-rounding"),
        ("pscover plan x.jpg --backend au", "auto"),
        ("pscover solve x.json --formulation pa", "pairwise"),
        ("pscover simulate --policy conso", "consolidation"),
    ],
)
def test_a_shell_completes_commands_and_names(monkeypatch: pytest.MonkeyPatch, words: str, expected: str) -> None:
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    monkeypatch.setenv("_PSCOVER_COMPLETE", "bash_complete")
    shown = CliRunner().invoke(app, [], prog_name="pscover")
    assert shown.output == f"plain,{expected}\n"

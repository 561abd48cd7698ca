"""The OR-Library's formats: all files at hand have the published sizes, and damaged text is told by line and number."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from pscover import Instance, InvalidInstance
from pscover.io import load_instance, save_instance
from pscover.io.orlib import REQUIRED, TextFormat, load

ORLIB = Path(__file__).parent.parent.parent / "shared" / "orlib"
SCP = "3 4\n1 2 3 4.5\n2 1 2\n1 3\n3 2 3 4\n"
RAIL = "3 4\n1 1 1\n2 2 1 3\n3 2 2 3\n4.5 1 3\n"
COVER = Instance.of([[1, 1, 0, 0], [0, 0, 1, 0], [0, 1, 1, 1]], required=REQUIRED, cost=[1, 2, 3, 4.5])


def write(folder: Path, text: str, name: str = "problem.txt") -> Path:
    (folder / name).write_text(text)
    return folder / name


def refusal(path: Path) -> str:
    with pytest.raises(InvalidInstance) as caught:
        load_instance(path)
    assert str(caught.value).startswith(f"{path}: ")
    return str(caught.value).removeprefix(f"{path}: ")


@pytest.mark.skipif(not ORLIB.exists(), reason="the OR-Library's files are not beside the repository")
def test_all_files_at_hand_have_the_published_sizes() -> None:
    formats = {"scp(row)": "scp", "rail(col)": "rail", "sts triples (header: n m)": "sts"}
    with (ORLIB / "INDEX.tsv").open() as index:
        rows = list(csv.DictReader(index, delimiter="\t"))
    assert len(rows) >= 60
    for row in rows:
        instance = load_instance(ORLIB / f"{row['name']}.txt")
        got = (instance.elements, instance.candidates, instance.probability.nnz)
        assert got == (int(row["rows"]), int(row["cols"]), int(row["nnz"])), row["name"]
        assert instance.meta.name == row["name"]
        assert instance.meta.source.endswith(formats[row["format"]])
        if row["kind"] == "unicost":
            assert (instance.cost == 1).all()


@pytest.mark.parametrize(("name", "text"), [("a.txt", SCP), ("a.scp", SCP), ("a.txt", RAIL), ("a.rail", RAIL)])
def test_both_formats_give_the_same_problem(name: str, text: str, tmp_path: Path) -> None:
    assert load_instance(write(tmp_path, text, name)).digest == COVER.digest


def test_one_candidate_meets_every_requirement(tmp_path: Path) -> None:
    instance = load_instance(write(tmp_path, SCP))
    assert (instance.coverage([1, 2]) >= instance.required).all()
    assert (instance.coverage([1]) < instance.required).tolist() == [False, True, False]


def test_steiner_triples(tmp_path: Path) -> None:
    fano = "7 7\n1 2 3\n1 4 5\n1 6 7\n2 4 6\n2 5 7\n3 4 7\n3 5 6\n"
    instance = load_instance(write(tmp_path, fano))
    assert instance.probability.toarray().sum(axis=0).tolist() == [3] * 7
    assert instance.probability.toarray().sum(axis=1).tolist() == [3] * 7
    assert (instance.cost == 1).all()


@pytest.mark.parametrize("suffix", [".txt", ".scp", ".rail"])
def test_round_trip(suffix: str, tmp_path: Path) -> None:
    save_instance(COVER, tmp_path / f"cover{suffix}")
    assert load_instance(tmp_path / f"cover{suffix}").digest == COVER.digest


def test_the_smallest_problem_fits_two_formats_that_agree(tmp_path: Path) -> None:
    assert load_instance(write(tmp_path, "1 1\n1\n1 1")).digest == Instance.of([[1.0]], REQUIRED).digest


def test_numbers_that_fit_two_formats_and_mean_different_problems(tmp_path: Path) -> None:
    # By rows: costs 3 and 1, both rows have column 2 alone. By columns: costs 3 and 2, a row each.
    text = "2 2 3 1 1 2 1 2"
    assert refusal(write(tmp_path, text)).startswith("expected numbers that fit one format, got some that fit scp and rail")
    assert load_instance(write(tmp_path, text, "a.scp")).cost.tolist() == [3, 1]
    assert load_instance(write(tmp_path, text, "a.rail")).cost.tolist() == [3, 2]
    assert load(write(tmp_path, text), TextFormat.RAIL).cost.tolist() == [3, 2]


def test_a_guessed_format_says_so(tmp_path: Path) -> None:
    for text, meant in ((SCP.replace("1 3", "1 9"), "scp"), (RAIL.replace("2 2 3", "2 2 9"), "rail"), ("3 1\n1 2 9", "sts")):
        message = refusal(write(tmp_path, text))
        assert message.startswith(f"read as {meant}: ")
        assert "got '9'; the format is a guess" in message
    for text, meant in ((SCP[:-4], "scp"), (RAIL[:-3], "rail")):
        assert refusal(write(tmp_path, text)).startswith(f"read as {meant}: ")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.scp", "", "expected the number of rows, got the end of the file"),
        ("a.scp", "3", "expected the number of columns, got the end of the file"),
        ("a.scp", SCP + "7", "line 6, number 1: expected the end of the file, got '7'"),
        (
            "a.scp",
            SCP[:-3],
            "line 5, number 1: expected the length of the list of row 3: a whole number up to 2, what is left, got '3'",
        ),
        ("a.scp", SCP.replace("4.5", "-4"), "line 2, number 4: expected a cost: a number above 0, got '-4'"),
        ("a.scp", SCP.replace("4.5", "nan"), "line 2, number 4: expected a finite number, got 'nan'"),
        ("a.scp", SCP.replace("4.5", "1e999"), "line 2, number 4: expected a finite number, got '1e999'"),
        ("a.scp", SCP.replace("4.5", "1_0"), "line 2, number 4: expected a finite number, got '1_0'"),
        ("a.scp", SCP.replace("4.5", "1-0"), "line 2, number 4: expected a finite number, got '1-0'"),
        ("a.scp", SCP.replace("2 1 2", "2 1 5"), "line 3, number 3: expected a column: a whole number from 1 to 4, got '5'"),
        ("a.scp", SCP.replace("2 1 2", "2 1 0"), "line 3, number 3: expected a column: a whole number from 1 to 4, got '0'"),
        (
            "a.scp",
            SCP.replace("2 1 2", "2 1 1.5"),
            "line 3, number 3: expected a column: a whole number from 1 to 4, got '1.5'",
        ),
        (
            "a.scp",
            SCP.replace("2 1 2", "2 1 1"),
            "line 3, number 3: expected each pair of row and column once, got '1', the second one",
        ),
        (
            "a.scp",
            "1000000000 4\n1 2",
            "expected at least 1000000006 numbers for 4 costs and 1000000000 rows, got a file of 4",
        ),
        ("a.scp", "-3 4\n", "line 1, number 1: expected the number of rows: a whole number from 1 to 2147483647, got '-3'"),
        (
            "a.rail",
            "1000000000 1\n1 1 1",
            "expected at least 1000000002 numbers for 1 columns that cover 1000000000 rows, got a file of 5",
        ),
        (
            "a.rail",
            "1 1000000000\n1 1 1",
            "expected at least 2000000002 numbers for 1000000000 columns that cover 1 rows, got a file of 5",
        ),
        ("a.rail", RAIL.replace("2 2 3", "2 2 4"), "line 4, number 4: expected a row: a whole number from 1 to 3, got '4'"),
        ("a.rail", RAIL.replace("4.5", "0"), "line 5, number 1: expected a cost: a number above 0, got '0'"),
        (
            "a.rail",
            RAIL[:-3],
            "line 5, number 2: expected the length of the list of column 4: a whole number up to 0, what is left, got '1'",
        ),
        (
            "a.sts",
            "1000000000 1\n1 2 3",
            "expected at least 1000000002 numbers for 1 triples that use 1000000000 columns, got a file of 5",
        ),
        ("a.sts", "3 1\n1 2 3 3", "line 2, number 4: expected the end of the file, got '3'"),
        ("a.sts", "3 1\n1 2 2", "line 2, number 3: expected each pair of row and column once, got '2', the second one"),
    ],
)
def test_damaged_text(name: str, text: str, message: str, tmp_path: Path) -> None:
    assert refusal(write(tmp_path, text, name)) == f"read as {name[2:]}: {message}"


@pytest.mark.parametrize(
    ("instance", "message"),
    [
        (Instance.of([[1, 0.5]]), "expected p = 1, got 0.5 for element 0, candidate 1"),
        (Instance.of([[1.0, 1.0]], conflicts=[(0, 1)]), "expected no conflicts, got 1"),
        (Instance.of([[1.0], [1.0]], required=[0.5, 0]), "expected requirements above 0, got 0 for element 1"),
        (Instance.of(np.zeros((0, 2))), "expected at least one row and one column, got 0 and 2"),
    ],
)
def test_what_the_format_cannot_hold(instance: Instance, message: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInstance, match="set cover alone; save as") as caught:
        save_instance(instance, tmp_path / "a.txt")
    assert str(caught.value).endswith(message)
    assert list(tmp_path.iterdir()) == []

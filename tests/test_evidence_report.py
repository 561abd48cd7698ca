"""The page of results holds everything it was given, loads nothing, and says what is not there."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from pscover import InvalidResult
from pscover.cli.app import app
from pscover.evidence.markdown import Code, Heading, Paragraph, Points, blocks, worded
from pscover.evidence.page import render_page
from pscover.evidence.results import KNOWN, File, markdown, missing, sections
from pscover.evidence.tables import Table, interval, number
from pscover.experiment.statistics import Interval

RUN = {
    "instance": "pile-1",
    "contestant": "highs",
    "limit": 20.0,
    "objective": 10.0,
    "bound": 9,
    "seconds": 20.01,
    "status": "limit",
    "peak_mib": 100.0,
}
PIXEL = b"\x89PNG\r\n\x1a\n"


class Page(HTMLParser):
    """Addresses that a page refers to, the texts of its cells, and whether its tags are closed."""

    def __init__(self, content: bytes) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.cells: list[str] = []
        self.open: list[str] = []
        self.feed(content.decode())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag in ("td", "th"):
            self.cells.append("")
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] in (["td"], ["th"]) or self.open[-2:-1] in (["td"], ["th"]):
            self.cells[-1] += data


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Some of everything."""
    folder = tmp_path / "results"
    (folder / "exact").mkdir(parents=True)
    (folder / "exact" / "Proven_plans.csv").write_text("seed,auto,milp\n0,0.184,1.6091\n1,0.068,> 57.8\n")
    (folder / "exact" / "machine.json").write_text("{}")
    (folder / "piles.md").write_text("# Piles\n\nOf **cloth**.\n\n| instance | auto |\n|---|---|\n| a\\|b | 429 [420] ✓ |\n")
    (folder / "piles.json").write_text(
        json.dumps({"schema": "pscover.bench/1", "runs": {"x": RUN, "y": {**RUN, "contestant": "scip"}}})
    )
    (folder / "piles.png").write_bytes(PIXEL)
    (folder / "table2").mkdir()
    (folder / "table2" / "sweep.json").write_text("{}")
    case = {"garments": 5, "seed": 0}
    runs = [{"engine": "highs/clique", "seconds": 0.5}, {"engine": "auto/clique", "seconds": 0.25}]
    (folder / "table2" / "results.jsonl").write_text(json.dumps({"case": case, "row": {"candidates": 150}}) + "\n")
    (folder / "table2" / "timings.jsonl").write_text(
        json.dumps({"case": case, "timing": {"candidates": 0.01, "runs": runs}}) + "\n"
    )
    return folder


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In an empty folder."""
    monkeypatch.chdir(tmp_path)


def report(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["bench", "report", *arguments])


def test_everything_given_is_in_the_page(results: Path, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    done = report("--results", str(results), "--no-plans", "-o", str(path), "--markdown", str(tmp_path / "page.md"))
    assert done.exit_code == 0, done.output
    page = Page(path.read_bytes())
    assert page.open == []
    for cell in ("0.184", "1.61", "> 57.8", "a|b", "429 [420] ✓", "highs", "scip", "0.25", "auto", "clique"):
        assert cell in page.cells, cell
    text = (tmp_path / "page.md").read_text()
    for word in ("## Dense piles", "Of **cloth**.", "| a\\|b | 429 [420] ✓ |", "1.61", "Not measured yet: groups"):
        assert word in text, word


def test_the_page_needs_nothing_else(results: Path) -> None:
    content = render_page(sections([results]), [File(name="p", media="image/png", content=PIXEL)])
    page = Page(content)
    assert page.addresses
    assert all(address.startswith(("data:", "#")) for address in page.addresses)
    anchors = re.findall(r" id='([^']+)'", content.decode())
    assert {address[1:] for address in page.addresses if address.startswith("#")} <= set(anchors)
    assert "default-src 'none'" in content.decode()
    assert "{{" not in content.decode()


def test_what_is_not_there_is_said_with_its_command(results: Path, tmp_path: Path) -> None:
    found = sections([results])
    assert [section.name for section in found] == ["table2", "exact", "piles"]
    assert missing(found) == [name for name in KNOWN if name not in ("table2", "exact", "piles")]
    done = report("--results", str(results), "--no-plans", "-o", str(tmp_path / "page.html"))
    assert "no results of groups: pscover bench groups" in done.stderr
    assert "bench groups" in (tmp_path / "page.html").read_text()
    assert "no results of piles" not in done.stderr


def test_a_folder_may_be_a_section_by_itself(results: Path) -> None:
    found = sections([results / "table2", results / "exact"])
    assert [section.name for section in found] == ["table2", "exact"]


def test_names_from_files_are_text(tmp_path: Path) -> None:
    folder = tmp_path / "<b>odd"
    folder.mkdir()
    (folder / "<img src=x>.csv").write_text("<script>,b\n<i>,'\"&\n")
    (folder / "README.md").write_text("# <u>\n\n[go](javascript:alert(1)) `<s>` **<p>** ![x](http://x/y.png)\n")
    content = render_page(sections([folder])).decode()
    body = content[content.index("<nav") : content.index("<script>\n")]
    for tag in ("<u>", "<img src=x", "<i>", "<s>", "<p>", "javascript:", "http://x"):
        assert tag not in body, tag


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--results", "nowhere", "-o", "x.html"), "nowhere: expected a folder of results, got nothing"),
        (("-o", "x.html"), "there is no bench/results here"),
        (("--results", ".", "-o", "x.pdf"), "ends in .html"),
        (("--results", ".", "-o", "x.html", "--markdown", "x.html"), "ends in .md"),
        (("--results", ".", "-o", "x.html"), "expected results of pscover's benchmarks, got none"),
    ],
)
def test_mistakes_are_one_line(
    arguments: tuple[str, ...], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = report(*arguments)
    assert done.exit_code == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "x.html").exists()


def test_damaged_files_are_named(results: Path) -> None:
    for name, content, said in (
        ("exact/Proven_plans.csv", "a,b\n1\n", r"Proven_plans\.csv, line 2: expected 2 values, got 1"),
        ("piles.json", "{", r"piles\.json: expected JSON"),
        ("piles.json", '{"schema": "pscover.bench/1", "runs": {"x": {}}}', r"piles\.json: expected runs of a contest"),
        ("table2/results.jsonl", "[]\n", r"results\.jsonl: expected a line a case"),
    ):
        path = results / name
        before = path.read_bytes()
        path.write_text(content)
        with pytest.raises(InvalidResult, match=said):
            sections([results])
        path.write_bytes(before)


def test_markdown_is_read_block_by_block() -> None:
    fence = "```sh\n# no head\n\nx | y\n```\n"
    text = f"# Head\none\ntwo\n\n- a\n  b\n- c\n\n    code  \n    more\n\n{fence}| k | v |\n|:--|--:|\n| 1 |\n"
    found = blocks(text, "n", "")
    assert found[:5] == [
        Heading("Head"), Paragraph("one two"), Points(("a b", "c")), Code("code  \nmore"), Code("# no head\n\nx | y")
    ]  # fmt: skip
    assert isinstance(found[5], Table)
    assert found[5].rows == (("1", ""),)


def test_filters_are_columns_of_words_with_a_choice() -> None:
    rows = (("a", "highs", "> 1.5 (2 of 5)"), ("a", "scip", "2–3"))
    found = worded(Table(name="t", title="", columns=("family", "backend", "s"), rows=rows))
    assert found.filters == ("backend",)
    assert found.text_columns >= {"family", "backend"}
    with pytest.raises(InvalidResult, match="expected 3 cells"):
        Table(name="t", title="", columns=("a", "b", "c"), rows=(("1",),))


def test_numbers_that_are_none_are_dashes() -> None:
    assert [number(value) for value in (None, float("nan"), 0.0, -1234.5)] == ["–", "–", "0", "-1 234"]
    assert interval(Interval(mean=float("nan"), low=float("nan"), high=float("nan")), 3).startswith("–")
    assert "# Results" in markdown([])

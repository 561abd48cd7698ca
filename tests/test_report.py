"""The report: one file that is whole, loads nothing, and takes no orders from names."""

from __future__ import annotations

import base64
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from pscover.errors import PscoverError
from pscover.generate.garments import garments
from pscover.planning import Plan, plan
from pscover.report import render_report, save_report
from pscover.scene import Scene

cv2 = pytest.importorskip("cv2")
VOID = {"meta", "input", "br", "image"}
HOSTILE = "</title><script>alert(1)</script>' onload='alert(2)' \" {{facts}} \ud800 ​$&\\1"


class Page(HTMLParser):
    """What a browser makes of a page: elements, their attributes, the text, and whether all that opens closes."""

    def __init__(self, content: bytes) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.feed(content.decode())
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def all(self, tag: str, attribute: str = "") -> list[dict[str, str]]:
        return [found for name, found in self.elements if name == tag and (not attribute or attribute in found)]


@pytest.fixture(scope="module")
def ten() -> Plan:
    return plan(garments(10))


@pytest.fixture(scope="module")
def photographed() -> Plan:
    labels = np.zeros((80, 160), dtype=int)
    labels[20:60, 10:60], labels[20:60, 60:110] = 1, 2
    return plan(Scene.of(labels, photo=np.full((80, 160, 3), 120, dtype=np.uint8), source="photos/table.jpg"))


def test_the_page_is_whole(ten: Plan) -> None:
    page = Page(render_report(ten))
    assert page.open == []
    assert len(page.all("tr", "data-grasp")) == len(ten.grasps)
    assert len(page.all("g", "data-grasp")) == len(ten.grasps)
    assert len(page.all("li", "data-garment")) == len(page.all("path", "data-garment")) == 10
    assert "{{" not in render_report(ten).decode()
    identities = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(identities) == len(set(identities))


def test_rows_and_ellipses_name_each_other(ten: Plan) -> None:
    page = Page(render_report(ten))
    for number, grasp in enumerate(ten.grasps, start=1):
        removes = " ".join(str(removed.garment) for removed in grasp.removes)
        for tag in ("tr", "g"):
            (found,) = [e for e in page.all(tag, "data-grasp") if e["data-grasp"] == str(number)]
            assert found["data-removes"] == removes
            assert found["tabindex"] == "0", "it is reached by the keyboard too"
    by = {e["data-garment"]: e["data-by"].split() for e in page.all("li", "data-garment")}
    assert by == {
        str(j): [str(k) for k, g in enumerate(ten.grasps, start=1) if j in {r.garment for r in g.removes}] for j in range(10)
    }


def test_every_layer_has_a_switch(photographed: Plan, ten: Plan) -> None:
    for found, layers in (
        (photographed, ["photo", "segments", "parts", "candidates", "grasps"]),
        (ten, ["segments", "parts", "candidates", "grasps"]),
    ):
        page = Page(render_report(found))
        assert [e["data-toggle"] for e in page.all("input")] == layers
        assert {e["data-layer"] for _, e in page.elements if "data-layer" in e} == set(layers)


def test_heights_have_a_switch_a_scale_and_figures(photographed: Plan) -> None:
    labels, depth = np.asarray(photographed.scene.labels), np.full((80, 160), 1.0)
    depth[labels == 1], depth[labels == 2] = 0.96, 0.93
    for picture in (photographed.scene.photo, None):
        content = render_report(plan(Scene.of(labels, photo=picture), depth=depth)).decode()
        page = Page(content.encode())
        assert page.open == []
        assert "heights" in [e["data-toggle"] for e in page.all("input")]
        assert [e["class"] for e in page.all("image", "data-layer") if e["data-layer"] == "heights"] == ["hidden"]
        assert "8 cm above the table" in page.words
        assert {"4.0 cm high, top 4.0", "7.0 cm high, top 7.0"} <= set(page.words)
        assert any("table found 1.000 m away" in words for words in page.words)
    assert "cm high" not in render_report(photographed).decode()


def test_nothing_is_loaded_from_anywhere(photographed: Plan) -> None:
    content = render_report(photographed).decode()
    page = Page(content.encode())
    links = [value for _, attributes in page.elements for name, value in attributes.items() if name in ("src", "href")]
    assert len(links) == 1
    assert links[0].startswith("data:image/jpeg;base64,/9j/")
    assert set(re.findall(r"https?://[^\s'\"]+", content)) == {"http://www.w3.org/2000/svg"}
    assert "url(" not in content
    (policy,) = [e["content"] for e in page.all("meta", "http-equiv")]
    assert policy.startswith("default-src 'none'; img-src data:;")
    script = content.partition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy, "the browser runs this script and no other"


def test_names_are_text_whatever_they_are() -> None:
    labels = np.zeros((60, 120), dtype=int)
    labels[10:50, 10:50], labels[10:50, 60:110] = 1, 2
    scene = Scene.of(labels, names=[HOSTILE, "<b>"], source=f"x/{HOSTILE.replace('/', '')}")
    page = Page(render_report(plan(scene)))
    assert page.open == []
    assert len(page.all("script")) == 1
    assert not page.all("b", "onload")
    assert not any(name.startswith("on") for _, attributes in page.elements for name in attributes)
    assert HOSTILE.replace("\ud800", "?") in page.words


def test_the_worst_cases_are_drawn() -> None:
    thin = np.zeros((100, 200), dtype=int)
    thin[10:13, 10:60], thin[50:90, 100:150] = 1, 2
    short = plan(thin)
    assert short.unmet
    content = render_report(short).decode()
    assert "class=short" in content
    assert "proof short" in content
    assert Page(content.encode()).open == []
    nothing = render_report(plan(np.zeros((30, 40), dtype=int))).decode()
    assert "nothing lies on the surface" in nothing
    assert Page(nothing.encode()).open == []
    one = render_report(plan(np.ones((1, 1), dtype=int), required=0))
    assert Page(one).open == []


def test_the_ellipses_lie_where_the_grasps_are(photographed: Plan) -> None:
    content = render_report(photographed).decode()
    for grasp in photographed.grasps:
        assert f"translate({grasp.x:.1f} {grasp.y:.1f})" in content


def test_outlines_enclose_their_segments() -> None:
    from pscover.outlines import outlines

    labels = np.zeros((50, 70), dtype=np.int32)
    labels[5:40, 10:60] = 1
    labels[15:30, 20:40] = 2
    for value, path in enumerate(outlines(labels), start=1):
        canvas = np.zeros(labels.shape, dtype=np.uint8)
        for ring in path.split("M")[1:]:
            points = [tuple(map(float, point.split())) for point in ring.rstrip("Z").split("L")]
            inside = np.zeros(labels.shape, dtype=np.uint8)
            cv2.fillPoly(inside, [np.round(np.array(points)).astype(np.int32)], 1)
            canvas ^= inside
        same = (canvas > 0) == (labels == value)
        assert same.mean() > 0.93
    assert outlines(labels)[0].count("M") == 2, "the hole is outlined"


def test_a_report_is_written_whole_or_not_at_all(ten: Plan, tmp_path: Path) -> None:
    save_report(ten, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_bytes() == render_report(ten)
    with pytest.raises(PscoverError, match="no folder"):
        save_report(ten, tmp_path / "none" / "report.html")

"""What the pages in docs/ show works: their Python runs, their commands end as shown, their links lead somewhere."""

from __future__ import annotations

import doctest
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("**/*.md"))
SHOWN = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
NEEDS = {
    "index.md": ("cv2", "skimage", "matplotlib"),
    "extending.md": ("cv2", "skimage"),
    "robot.md": ("cv2", "skimage", "matplotlib"),
}
"""Packages beyond the core that a page's examples use."""

pytestmark = pytest.mark.skipif(not DOCS.is_dir(), reason="docs/ is not in an installed package")


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), flags=re.DOTALL | re.MULTILINE)


def needed(page: Path) -> None:
    for package in NEEDS.get(page.name, ()):
        pytest.importorskip(package)


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "python")], ids=lambda page: page.stem)
def test_python_runs(page: Path, tmp_path: Path) -> None:
    """The blocks of a page run in order, in a process of their own."""
    needed(page)
    script = tmp_path / f"{page.stem}.py"
    script.write_text("\n".join(blocks(page, "python")))
    ended = subprocess.run([sys.executable, "-W", "error", script], capture_output=True, text=True, cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "console")], ids=lambda page: page.stem)
def test_commands_end_as_shown(page: Path, tmp_path: Path) -> None:
    """`$ pscover ...` and what it prints; `...` stands for anything."""
    needed(page)
    shutil.copytree(ROOT / "instances", tmp_path / "instances")
    shown = "".join(blocks(page, "console"))
    for line, expected in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", shown, flags=re.MULTILINE):
        program, *arguments = shlex.split(line)
        assert program == "pscover", line
        ended = subprocess.run(
            [sys.executable, "-m", "pscover", *arguments],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env=os.environ | {"COLUMNS": "100"},
        )
        assert ended.returncode == 0, f"{line}\n{ended.stderr}"
        assert doctest.OutputChecker().check_output(expected, ended.stdout, SHOWN), f"{line}\n{ended.stdout}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


def test_every_page_is_in_the_navigation() -> None:
    listed = set(re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text()))
    assert listed == {page.relative_to(DOCS).as_posix() for page in PAGES}

"""A hook of MkDocs: formulas between dollar signs become MathML, so that pages need no script and no network."""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert

FENCED = re.compile(r"(^[ ]*```.*?^[ ]*```|`[^`\n]+`)", re.DOTALL | re.MULTILINE)
DISPLAY = re.compile(r"^[ ]*(?:> )?\$\$\s*(.+?)\s*\$\$", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"(?<![\\$\w])\$(?=\S)([^$\n]+?(?:\n[^$\n]+?)?)(?<=\S)\$(?![\w$])")


PLACE = re.compile(r"formula-(\d+)-here")


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The page with a word in place of each formula, so that Markdown does not see it; code is left alone."""
    page.formulas = []

    def keep(formula: str, display: str) -> str:
        page.formulas.append(convert(" ".join(formula.split()), display=display))
        return f"formula-{len(page.formulas) - 1}-here"

    def converted(text: str) -> str:
        text = DISPLAY.sub(lambda found: f"\n{keep(found[1], 'block')}\n", text)
        return INLINE.sub(lambda found: keep(found[1], "inline"), text)

    parts = FENCED.split(markdown)
    return "".join(part if k % 2 else converted(part) for k, part in enumerate(parts))


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """The page with its formulas."""
    return PLACE.sub(lambda found: page.formulas[int(found[1])], html)

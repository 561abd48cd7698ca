"""The gallery is what the docstrings say, and GitHub can show it."""

from __future__ import annotations

import re

import pytest

from pscover import gallery, registry
from pscover.errors import UnknownName

NAMES = registry.names("formulation")


def test_the_committed_gallery_is_fresh() -> None:
    assert gallery.path().read_text(encoding="utf-8") == gallery.gallery(), "run `python -m pscover.gallery`"


def test_main_writes_the_page(tmp_path: object, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    page = gallery.path().parent.__class__(str(tmp_path)) / "README.md"
    monkeypatch.setattr(gallery, "path", lambda: page)
    gallery.main()
    assert page.read_text(encoding="utf-8") == gallery.gallery()
    assert "README.md" in capsys.readouterr().out


def test_unknown_names_get_a_suggestion() -> None:
    with pytest.raises(UnknownName, match="did you mean 'clique'"):
        gallery.card("cliqe")


@pytest.mark.parametrize("name", NAMES)
def test_cards_say_what_cards_must(name: str) -> None:
    card = gallery.card(name)
    for heading in ("**Variables.**", "- **Relation:**", "- **Size:**", "- **Use it**", "- **Source:**"):
        assert heading in card
    assert str(registry.formulation(name).relation) in card.split("- **Relation:**")[1].split("- **Size:**")[0]
    assert "$$" in card
    assert f"## {name}\n" in gallery.gallery()
    assert f"[{name}.py]({name}.py)" in gallery.gallery()
    assert (gallery.path().parent / f"{name}.py").exists()


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_is_explained(name: str) -> None:
    for parameter, _, meaning in gallery.parameters(name):
        assert meaning.endswith("."), f"{name}.{parameter} has no meaning in the class docstring"


@pytest.mark.parametrize("name", NAMES)
def test_mathematics_survives_markdown(name: str) -> None:
    card = gallery.card(name)
    assert card.count("$$") % 2 == 0
    displayed = re.findall(r"\$\$(.*?)\$\$", card, re.DOTALL)
    inline = re.findall(r"\$([^$]*)\$", re.sub(r"\$\$.*?\$\$", "", card, flags=re.DOTALL))
    assert re.sub(r"\$\$.*?\$\$", "", card, flags=re.DOTALL).count("$") == 2 * len(inline)
    for formula in (*displayed, *inline):
        # Markdown eats a backslash before punctuation, so that \{ and \, arrive as { and a comma.
        assert not re.search(r"\\[^A-Za-z]", formula), formula
        assert "*" not in formula
        assert not re.search(r"<\w", formula), f"reads as a tag: {formula}"
        assert formula.count("{") == formula.count("}")
    for formula in inline:
        assert "\n" not in formula, f"broken over two lines: {formula}"
        assert formula == formula.strip()
    for block in re.split(r"\n\n", card):
        assert "$$" not in block or (block.startswith("$$") and block.endswith("$$"))

"""What README.md says can be done, can be done."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

README = (Path(__file__).parents[1] / "README.md").read_text()


def test_the_two_commands_stand_on_top() -> None:
    blocks = re.findall(r"<!-- command: (\w+) -->\n```sh\n(.*?)```", README, flags=re.DOTALL)
    assert [name for name, _ in blocks] == ["plan", "test"]
    assert README.index("<!-- command: test -->") < 2500


def test_the_python_in_it_runs(monkeypatch: object) -> None:
    test = doctest.DocTestParser().get_doctest(README, {}, "README.md", "README.md", 0)
    assert test.examples
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    runner.run(test)
    assert runner.summarize(verbose=False).failed == 0


def test_links_lead_somewhere() -> None:
    root = Path(__file__).parents[1]
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if not target.startswith("http") and (root / "pscover").is_dir():
            assert (root / target).exists(), target

"""The gallery of formulations: `formulations/README.md`, written from the files' own docstrings.

Run `python -m pscover.gallery` in a checkout to write it anew.
"""

from __future__ import annotations

import importlib
import inspect
import json
import re
import sys
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from pscover import registry

INTRODUCTION = """\
# Formulations

Each file in this folder writes a probabilistic set-cover instance as a mixed-integer linear model in its own way. The
mathematics is in the file's docstring; this page is made of those docstrings by `python -m pscover.gallery`.

A formulation's *relation* says what its model proves about its goal: *exact* models have the same plans and the same
objective; a *relaxation* has at least the goal's plans and an objective that is never higher, so that its bounds hold;
a *restriction* has only some of the goal's plans, so that its plans hold. Several formulations pursue a goal of their
own, such as the best plan within a budget: every plan is weighed by that goal, whatever the engine says.

Common to all: $x_i = 1$ when candidate $i$ is in the plan, $n$ candidates, $m$ elements, $p_{ij}$ the probability that
candidate $i$ covers element $j$ independently of the others, $q_j$ the required probability, $c_i$ the cost.
"""

CLOSING = """\
## A formulation of your own

Put a file beside these, a frozen dataclass with the attributes of `pscover.formulation.Formulation` whose last line reads
`formulation = TheClass`, or register it from your own package under the entry-point group `pscover.formulations`. Then
`pscover.testing.check_formulation` holds it against enumeration.
"""


def card(name: str) -> str:
    """The mathematics of a formulation: the docstring of its file, in Markdown with LaTeX between dollar signs.

    Raises
    ------
    UnknownName
        With the nearest name.

    Examples
    --------
    >>> print(card("clique").splitlines()[0])
    Conflicts as cliques, rows scaled and truncated: the default.
    """
    found = registry.lookup("formulation", name)
    return inspect.cleandoc(importlib.import_module(found.__module__).__doc__ or "")


def parameters(name: str) -> list[tuple[str, str, str]]:
    """Name, default as JSON and meaning of each parameter of a formulation, in order.

    Examples
    --------
    >>> parameters("robust")[1]
    ('gamma', '1', 'How many of the chosen candidates may deviate in each row, at least 0.')
    """
    found = registry.lookup("formulation", name)
    meanings = _meanings(inspect.getdoc(found) or "")
    return [(f.name, _default(f), meanings.get(f.name, "")) for f in fields(found)]


def gallery() -> str:
    """The whole page: introduction, table, and the card of every formulation."""
    names = [name for name in registry.names("formulation") if _is_ours(name)]
    table = ["| formulation | relation | what it finds | parameters |", "|---|---|---|---|"]
    table += [f"| [{_code(name)}](#{name}) | {_relation(name)} | {_title(name)} | {_short(name)} |" for name in names]
    return "\n".join([INTRODUCTION, *table, "", *(_section(name) for name in names), CLOSING])


def path() -> Path:
    """Where the gallery lies: beside the formulations, in a checkout or an installed package."""
    return Path(importlib.import_module(registry.PACKAGES["formulation"]).__path__[0]) / "README.md"


def main() -> None:
    """Write the gallery to `path()`."""
    path().write_text(gallery(), encoding="utf-8")
    sys.stdout.write(f"wrote {path()}\n")


def _is_ours(name: str) -> bool:
    module: str = registry.lookup("formulation", name).__module__
    return module.startswith(registry.PACKAGES["formulation"] + ".")


def _relation(name: str) -> str:
    return str(registry.formulation(name).relation)


def _title(name: str) -> str:
    return card(name).splitlines()[0].rstrip(".")


def _short(name: str) -> str:
    return ", ".join(_code(f"{parameter}={default}") for parameter, default, _ in parameters(name)) or "none"


def _section(name: str) -> str:
    title, _, body = card(name).partition("\n")
    lines = [f"## {name}", "", f"*{title.rstrip('.')}.* [{name}.py]({name}.py)", body]
    if parameters(name):
        lines += ["", "| parameter | default | meaning |", "|---|---|---|"]
        lines += [f"| {_code(p)} | {_code(default)} | {meaning} |" for p, default, meaning in parameters(name)]
    return "\n".join([*lines, ""])


def _code(text: str) -> str:
    return f"`{text}`"


def _default(parameter: Any) -> str:
    if parameter.default is MISSING:
        return "required"
    return json.dumps(parameter.default)


def _meanings(docstring: str) -> dict[str, str]:
    """What numpydoc's section Parameters says of each name."""
    section = re.search(r"^Parameters\n-+\n(.*?)(?:\n\n\w+\n-+\n|\Z)", docstring, re.DOTALL | re.MULTILINE)
    found = re.findall(r"^(\w+)\n((?:[ ]+.*\n?)+)", section.group(1) if section else "", re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in found}


if __name__ == "__main__":
    main()

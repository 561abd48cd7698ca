"""`pscover info`: what an instance is made of, and which requirements are out of reach."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import Exit
from pscover.cli.options import FILE, json_option

if TYPE_CHECKING:
    from pscover.infeasibility import Unreachable
    from pscover.instance import Instance

SECONDS = 10.0
"""How long to look for requirements that are out of reach."""


@click.command("info", short_help="Describe an instance and find requirements that no plan can meet.")
@click.argument("instance", type=FILE)
@json_option
def command(instance: Path, as_json: bool) -> Exit:
    """Describe INSTANCE: its size, density and ranges, and which of its requirements no plan can meet.

    \b
    Example:
      pscover info table.json
    """
    from pscover.infeasibility import unreachable
    from pscover.io import load_instance

    problem = load_instance(instance)
    far = unreachable(problem, seconds=SECONDS)
    if as_json:
        from pscover.cli.output import show_document

        show_document(_document(problem, far))
    else:
        _print(problem, far)
    return Exit.VERIFIED


def components(instance: Instance) -> int:
    """Into how many independent problems the instance falls: elements linked by candidates, candidates by conflicts."""
    from scipy.sparse import block_array, coo_array
    from scipy.sparse.csgraph import connected_components

    if instance.elements + instance.candidates == 0:
        return 0
    members = coo_array(instance.conflicts.matrix(instance.candidates))
    blocks = [[None, instance.probability, None], [None, None, members.T], [None, None, None]]
    sizes = (instance.elements, instance.candidates, len(instance.conflicts))
    empty = [coo_array((size, size)) for size in sizes]
    for k in range(3):
        blocks[k][k] = empty[k]
    return int(connected_components(block_array(blocks), directed=False, return_labels=False))


def _document(instance: Instance, far: tuple[Unreachable, ...]) -> dict[str, Any]:
    import numpy as np

    from pscover.cli.documents import instance_document

    p = instance.probability
    cells = instance.elements * instance.candidates
    return {
        **instance_document(instance),
        "stored_probabilities": int(p.nnz),
        "density": p.nnz / cells if cells else None,
        "components": components(instance),
        "probability": _range(p.data),
        "required": _range(instance.required),
        "cost": _range(instance.cost),
        "cliques": len(instance.conflicts),
        "clique_size": _range(np.diff(instance.conflicts.starts)),
        "conflicting_pairs_at_most": instance.conflicts.pair_count(),
        "optimum": instance.meta.optimum,
        "out_of_reach": [{**asdict(u), "name": instance.meta.element(u.element)} for u in far],
    }


def _range(values: Any) -> dict[str, float] | None:
    return {"lowest": float(values.min()), "highest": float(values.max())} if len(values) else None


def _print(instance: Instance, far: tuple[Unreachable, ...]) -> None:
    import numpy as np

    from pscover.cli.output import show
    from pscover.cli.tables import diagnosed, facts, headline
    from pscover.cli.words import NOTHING, count, number, percent, spread
    from pscover.infeasibility import Diagnosis

    p, meta, conflicts = instance.probability, instance.meta, instance.conflicts
    cells = instance.elements * instance.candidates
    sizes = spread(np.diff(conflicts.starts))
    reach = (
        f"{count(len(far), 'requirement')} out of reach of every plan" if far else "each requirement by itself can be met"
    )
    show(
        headline(instance),
        facts(
            [
                ("source", meta.source or NOTHING),
                (
                    "probabilities",
                    f"{p.nnz} stored ({percent(p.nnz / cells if cells else 0)} of all pairs), {spread(p.data)}",
                ),
                ("required", spread(instance.required)),
                ("cost", spread(instance.cost)),
                ("conflicts", f"{count(len(conflicts), 'clique')} of {sizes} candidates" if len(conflicts) else "none"),
                ("components", str(components(instance))),
                ("known optimum", NOTHING if meta.optimum is None else number(meta.optimum)),
                ("reach", reach),
                ("digest", instance.digest),
            ]
        ),
    )
    if far:
        show("", diagnosed(instance, Diagnosis(unreachable=far)))

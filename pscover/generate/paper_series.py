"""The instances of the paper's Table 2: 5, 10, ... 35 garments that do not overlap, each series five more than the last.

Run `python -m pscover.generate.paper_series FOLDER` to write garments-05.json to garments-35.json.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import click

from pscover.errors import PscoverError
from pscover.generate.garments import garments
from pscover.grasping.candidates import candidates
from pscover.instance import Instance
from pscover.io import save_instance

COUNTS = (5, 10, 15, 20, 25, 30, 35)


def series(seed: int = 0) -> Iterator[tuple[str, Instance]]:
    """Names and instances, with the paper's settings.

    Parameters
    ----------
    seed
        Of the garments and of the draw of the candidates.

    Examples
    --------
    >>> name, instance = next(series())
    >>> name, instance.elements
    ('garments-05', 5)
    """
    for count in COUNTS:
        name, instance = f"garments-{count:02}", candidates(garments(count, seed), seed=seed)
        yield name, replace(instance, meta=replace(instance.meta, name=name))


@click.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option("--seed", default=0, show_default=True, help="Of the garments and of the draw of the candidates.")
def main(folder: Path, seed: int) -> None:
    """Write the instances of the paper's Table 2 to FOLDER."""
    try:
        for name, instance in series(seed):
            save_instance(instance, folder / f"{name}.json")
            click.echo(f"{name}: {instance.candidates} candidates for {instance.elements} garments")
    except PscoverError as error:
        raise click.ClickException(str(error)) from None


if __name__ == "__main__":
    main()

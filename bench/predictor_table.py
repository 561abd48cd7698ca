"""Experiments that differ by the predictor, scene by scene: objects per transport, and what each predictor changes.

python bench/predictor_table.py paper=results/ ellipse=fitted/ logistic=extended/ --policy segment -o episodes.csv

Each folder is one of `pscover simulate`. Differences are to the first, over the scenes that all of them have; intervals are
by the bootstrap over these.
"""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path

from pscover.experiment.statistics import Interval, bootstrap

Episodes = dict[int, dict[str, str]]
"""The rows of `episodes.csv` by the number of the scene."""


def episodes(folder: Path, policy: str) -> Episodes:
    """Those of a policy."""
    with (folder / "episodes.csv").open(newline="") as file:
        return {int(row["seed"]): row for row in csv.DictReader(file) if row["policy"] == policy}


def segmenter(folder: Path) -> str:
    """What found the garments."""
    return str(json.loads((folder / "experiment.json").read_text())["segmenter"])


def compared(found: dict[str, Episodes]) -> list[str]:
    """The table in Markdown."""
    shared = sorted(set.intersection(*(set(own) for own in found.values())))
    base = next(iter(found.values()))
    lines = ["| predictor | scenes | OpT | difference | trips | fell off |", "|---|---:|---:|---:|---:|---:|"]
    for name, own in found.items():
        opt = bootstrap([float(own[seed]["opt"]) for seed in shared])
        change = bootstrap([float(own[seed]["opt"]) - float(base[seed]["opt"]) for seed in shared])
        said = "–" if own is base else _said(change, "+")
        trips, fallen = (sum(float(own[seed][column]) for seed in shared) / len(shared) for column in ("trips", "fallen"))
        lines.append(f"| {name} | {len(shared)} | {_said(opt)} | {said} | {trips:.1f} | {fallen:.1f} |")
    return lines


def _said(interval: Interval, sign: str = "") -> str:
    return f"{interval.mean:{sign}.2f} ({interval.low:{sign}.2f} to {interval.high:{sign}.2f})"


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", metavar="PREDICTOR=DIR")
    parser.add_argument("--policy", default="segment")
    parser.add_argument("-o", "--output", type=Path, help="all episodes, as CSV")
    asked = parser.parse_args()
    folders = {name: Path(folder) for name, _, folder in (given.partition("=") for given in asked.folders)}
    found = {name: episodes(folder, asked.policy) for name, folder in folders.items()}
    print(*compared(found), sep="\n")
    if asked.output:
        rows = [
            {"predictor": name, "segmenter": segmenter(folders[name]), **own[seed]}
            for name, own in found.items()
            for seed in sorted(own)
        ]
        with asked.output.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()

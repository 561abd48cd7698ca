"""Our engine against others on the same instances: each in a process of its own, in its best settings, the same threads.

python bench/peers/contest.py --family piles --ours 0.5 10 --peers 60 --seeds 2 --out results.csv
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterator
from pathlib import Path

import pscover
from pscover import registry
from pscover.generate.garments import garments
from pscover.generate.psc import psc_on_incidence
from pscover.grasping.candidates import candidates
from pscover.grasping.sampling import Sampling
from pscover.instance import Instance
from pscover.io import load_instance

ORLIB = Path(__file__).parents[3] / "shared" / "orlib"
PEERS = ("highs", "scip", "cpsat")
COVERS = ("scp41", "scp61", "scpa1", "scpc1", "scpd1", "scpnre1", "scpnrg1", "rail507", "sts135", "scpcyc09", "scpclr12")
PROBABILISTIC = (
    ("scp41", 0.9, None), ("scp41", 0.99, 5), ("scp61", 0.95, None), ("scp61", 0.99, 10), ("scpa1", 0.95, None),
    ("scpa1", 0.95, 10), ("scpd1", 0.95, None), ("scpd1", 0.95, 20), ("scpnre1", 0.95, None),
)  # fmt: skip


def piles(seeds: int, largest: int) -> Iterator[tuple[str, Instance]]:
    """Garments dropped over each other; 6 instances a size and seed."""
    for count in (35, 60, 100, 200):
        for seed in range(seeds if count <= largest else 0):
            scene = garments(count, seed, layout="piled", size=(282, 470) if count <= 100 else (564, 940))
            for required in (0.7, 0.9, 0.95):
                for points in (5, 20):
                    yield (
                        f"pile{count}-q{required}-k{points}-s{seed}",
                        candidates(scene, sampling=Sampling(points=points), required=required),
                    )


def apart(seeds: int, largest: int) -> Iterator[tuple[str, Instance]]:
    """Garments that lie apart, at the settings of the paper."""
    for seed in range(seeds):
        yield f"apart35-s{seed}", candidates(garments(min(35, largest), seed))


def orlib(seeds: int, largest: int) -> Iterator[tuple[str, Instance]]:
    """Plain set cover."""
    for name in COVERS:
        yield name, load_instance(ORLIB / f"{name}.txt")


def psc(seeds: int, largest: int) -> Iterator[tuple[str, Instance]]:
    """Probabilistic rows on OR-Library incidence, without and with cliques."""
    for name, required, size in PROBABILISTIC:
        for seed in range(1, seeds + 1):
            built = psc_on_incidence(load_instance(ORLIB / f"{name}.txt"), required=required, clique_size=size, seed=seed)
            yield f"{name}-q{required}-c{size or 0}-s{seed}", built


FAMILIES = {"piles": piles, "apart": apart, "orlib": orlib, "psc": psc}


def main() -> None:
    """Run the contest and print one row an instance."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--family", choices=FAMILIES, required=True)
    parser.add_argument("--ours", type=float, nargs="+", default=[0.5, 10.0], help="seconds of auto, one run each")
    parser.add_argument("--peers", type=float, default=60.0, help="seconds of each peer; 0 for none")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--largest", type=int, default=100, help="most garments")
    parser.add_argument("--only", default="", help="only instances whose name contains this")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    from pscover.engine.warm import warming

    warming().wait(600.0)
    runs = [("auto", seconds) for seconds in given.ours]
    runs += [(peer, given.peers) for peer in PEERS if given.peers and not registry.missing(registry.lookup("backend", peer))]
    rows = []
    for name, instance in FAMILIES[given.family](given.seeds, given.largest):
        if given.only not in name:
            continue
        row: dict[str, object] = {"instance": name, "candidates": instance.candidates}
        for backend, seconds in runs:
            try:
                result = pscover.solve(instance, backend=backend, time=seconds)
                text = f"{result.objective:g} [{result.bound:g}]{'*' if result.status == 'optimal' else ''}"
                took = result.timing.total
            except pscover.PscoverError as error:
                text, took = type(error).__name__, math.nan
            row[f"{backend} {seconds:g}s"] = text
            row[f"{backend} {seconds:g}s seconds"] = f"{took:.2f}"
        rows.append(row)
        sys.stdout.write("  ".join(str(value) for value in row.values()) + "\n")
        sys.stdout.flush()
    if given.out and rows:
        with given.out.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()

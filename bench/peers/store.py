"""Results on disk: one JSON file a bench, written whole after each run, so that a sweep that was killed goes on."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import msgspec

from bench.peers.families import Case
from bench.peers.runner import Contestant, Run, measure, now
from pscover.evidence.machine import this_machine
from pscover.files import write_bytes

SCHEMA = "pscover.bench/1"
RESULTS = Path(__file__).parents[1] / "results"


class Store:
    """The runs of one bench.

    Parameters
    ----------
    path
        Of the file; made at the first run.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.runs: dict[str, dict[str, Any]] = {}
        if path.exists():
            self.runs = json.loads(path.read_text())["runs"]

    @staticmethod
    def key(instance: str, contestant: str, limit: float, seed: int) -> str:
        """What makes a run another one."""
        return f"{instance} | {contestant} | {limit:g} s | seed {seed}"

    def has(self, instance: str, contestant: Contestant, seed: int = 0) -> bool:
        """Whether that was measured."""
        return self.key(instance, contestant.name, contestant.limit, seed) in self.runs

    def find(self, instance: str, contestant: str, limit: float, seed: int = 0) -> dict[str, Any] | None:
        """That run, or None."""
        return self.runs.get(self.key(instance, contestant, limit, seed))

    def add(self, run: Run) -> None:
        """Keep a run and write the file; another process may have added to it meanwhile."""
        if self.path.exists():
            self.runs = json.loads(self.path.read_text())["runs"] | self.runs
        key = self.key(run.instance, run.contestant, run.limit, run.seed)
        self.runs[key] = run.document() | {"when": now(), "machine": msgspec.to_builtins(this_machine())}
        document = {"schema": SCHEMA, "clock": "CPU seconds of the contestant's processes", "runs": self.runs}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(self.path, _text(document).encode())


def _text(document: dict[str, Any]) -> str:
    """JSON with one run a line: files that can be read and compared."""
    head = {name: value for name, value in document.items() if name != "runs"}
    lines = [f" {json.dumps(key)}: {json.dumps(run)}" for key, run in sorted(document["runs"].items())]
    return json.dumps(head)[:-1] + ', "runs": {\n' + ",\n".join(lines) + "\n}}\n"


def sweep(store: Store, cases: list[Case], contestants: list[Contestant], *, again: bool = False, seed: int = 0) -> None:
    """Measure what is missing, one process at a time, each instance by all before the next."""
    for case in cases:
        todo = [one for one in contestants if again or not store.has(case.name, one, seed)]
        if not todo:
            continue
        instance = case.load()
        for contestant in todo:
            run = measure(case.name, instance, contestant, seed)
            sys.stdout.write(
                f"{now()} {case.name} {contestant.name} {contestant.limit:g} s: "
                f"{run.objective} [{run.bound}] {run.status.splitlines()[-1] if run.status else ''} {run.seconds:.1f} s\n"
            )
            sys.stdout.flush()
            if not run.status.startswith("died"):
                store.add(run)

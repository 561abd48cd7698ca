"""Run one contestant on one instance under a limit of CPU seconds, and check every plan it tells."""

from __future__ import annotations

import contextlib
import json
import math
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pscover.evidence.cpu_clock import CpuClock
from pscover.instance import Instance
from pscover.io import save_instance

CHILD = Path(__file__).parent / "child.py"
BY_WALL = ("cft",)
POLL = 0.02
LOADING = 600.0
"""CPU seconds that a contestant may take to load; not on its clock."""
SLACK = 1e-6
"""By how much a contestant's plan may miss a requirement: the tolerance of the engines."""
PATIENCE = 0.25
"""CPU seconds beyond the limit after which its process is ended."""
GRACE = 0.02
"""CPU seconds beyond the limit within which what is told still counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contestant:
    """Who runs, how, and for how many CPU seconds."""

    engine: str
    limit: float
    options: dict[str, Any] = field(default_factory=dict)
    label: str = ""

    @property
    def name(self) -> str:
        """As in the tables."""
        return self.label or self.engine


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What one contestant did on one instance.

    Parameters
    ----------
    trace
        (CPU seconds, objective or None, bound or None) at each improvement; every plan checked.
    rejected
        Plans told that miss a requirement by more than `SLACK` or hold a conflict.
    """

    instance: str
    digest: str
    contestant: str
    limit: float
    seed: int
    options: dict[str, Any]
    versions: dict[str, str]
    trace: list[tuple[float, float | None, float | None]]
    objective: float | None
    bound: float | None
    plan: list[int] | None
    status: str
    seconds: float
    load_seconds: float
    rejected: int
    peak_mib: float
    commit: str

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return asdict(self)


def measure(name: str, instance: Instance, contestant: Contestant, seed: int = 0) -> Run:
    """Run a contestant to its end or to its limit."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "instance.npz")
        save_instance(instance, path)
        job = {
            "instance": str(path),
            "contestant": contestant.engine,
            "limit": contestant.limit,
            "seed": seed,
            "options": contestant.options,
        }
        Path(folder, "job.json").write_text(json.dumps(job))
        command = [sys.executable, str(CHILD), str(Path(folder, "job.json"))]
        lines, spent, peak = _watch(command, contestant.limit, _environment(contestant.engine))
    return _judge(name, instance, contestant, seed, lines, spent, peak)


def _environment(engine: str) -> dict[str, str]:
    """For an engine that can only be given a limit on wall time: a monotonic clock of CPU seconds, where a compiler is."""
    compiler = shutil.which("cc")
    if engine not in BY_WALL or compiler is None:
        return dict(os.environ)
    library = Path(tempfile.gettempdir()) / f"pscover-bench-cpu-time-{os.getuid()}.so"
    source = str(CHILD.with_name("cpu_time.c"))
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", str(library), source], check=True)
    return dict(os.environ, LD_PRELOAD=str(library))


def _watch(command: list[str], limit: float, environment: dict[str, str]) -> tuple[list[dict[str, Any]], float, float]:
    """The lines a contestant said, the CPU seconds it took, its peak memory with its workers in MiB."""
    with tempfile.TemporaryFile("w+") as errors:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True, env=environment)
        assert process.stdout is not None
        inbox: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        stream = process.stdout

        def listen() -> None:
            for line in stream:
                inbox.put(line)
            inbox.put(None)

        listener = threading.Thread(target=listen, daemon=True)
        listener.start()
        clock, lines, loaded, peak, over = CpuClock(process.pid), [], math.inf, 0.0, False
        while not over:
            try:
                text = inbox.get(timeout=POLL)
                if text is None:
                    break
                lines.append(json.loads(text))
                loaded = lines[-1].get("loaded", loaded)
            except queue.Empty:
                pass
            now = clock()
            peak = max(peak, _memory([process.pid, *clock.family]))
            over = now > (loaded + limit + PATIENCE if math.isfinite(loaded) else LOADING)
        spent = clock() - loaded
        family = list(clock.family)
        process.kill()
        process.wait()
        _end(family)
        listener.join(timeout=5.0)
        stream.close()
        while not inbox.empty():
            text = inbox.get()
            if text is not None and text.endswith("\n"):
                lines.append(json.loads(text))
        errors.seek(0)
        if not math.isfinite(loaded):
            raise RuntimeError(f"{command}: did not load: {errors.read()[-2000:]}")
        if not over and not any("ended" in line for line in lines):
            lines.append({"died": errors.read()[-500:]})
    return lines, spent, peak


def _end(family: list[int]) -> None:
    """Workers see their input end when their parent dies, but not inside an engine."""
    for pid in family:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGKILL)


def _memory(pids: list[int]) -> float:
    total = 0
    for pid in pids:
        try:
            total += int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        except (OSError, IndexError):
            continue
    return total * 4096 / 2**20


def _judge(
    name: str,
    instance: Instance,
    contestant: Contestant,
    seed: int,
    lines: list[dict[str, Any]],
    spent: float,
    peak: float,
) -> Run:
    whole = bool((instance.cost == np.round(instance.cost)).all())
    trace: list[tuple[float, float | None, float | None]] = []
    best, bound, plan, rejected = math.inf, -math.inf, None, 0
    first = next(line for line in lines if "loaded" in line)
    last: dict[str, Any] = next((line for line in lines if "ended" in line), {})
    status = str(last.get("status", "limit"))
    for line in lines:
        if "died" in line:
            status = f"died: {line['died']}"
        if "t" not in line or line["t"] > contestant.limit + GRACE:
            continue
        better = False
        if line["chosen"] is not None:
            cost = _cost(instance, line["chosen"])
            rejected += cost is None
            if cost is not None and cost < best:
                best, plan, better = cost, line["chosen"], True
        claimed = -math.inf if line["bound"] is None else line["bound"]
        claimed = math.ceil(claimed - 1e-6 * max(1.0, abs(claimed))) if whole and math.isfinite(claimed) else claimed
        if claimed > bound:
            bound, better = claimed, True
        if better:
            told = (best if math.isfinite(best) else None, bound if math.isfinite(bound) else None)
            trace.append((round(line["t"], 4), *told))
    return Run(
        instance=name,
        digest=instance.digest,
        contestant=contestant.name,
        limit=contestant.limit,
        seed=seed,
        options=contestant.options,
        versions=first["versions"],
        trace=trace,
        objective=None if plan is None else best,
        bound=bound if math.isfinite(bound) else None,
        plan=plan,
        status=status,
        seconds=round(float(last.get("ended", spent)), 4),
        load_seconds=round(float(first["loaded"]), 3),
        rejected=rejected,
        peak_mib=round(max(peak, float(last.get("peak_mib", 0.0))), 1),
        commit=commit(),
    )


def _cost(instance: Instance, chosen: list[int]) -> float | None:
    """What a plan costs, or None if it is none."""
    picks = np.array(chosen, dtype=np.int64)
    if len(instance.conflicts.broken_by(picks)):
        return None
    # A plan of plain set cover may be told by its sets alone.
    missed = instance.required - instance.coverage(picks)
    return float(instance.cost[picks].sum()) if (missed <= SLACK).all() else None


def commit() -> str:
    """Of the tree that was measured, with a mark where it has changes."""
    root = Path(__file__).parents[2]
    done = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=root, capture_output=True, text=True, check=False)
    return done.stdout.strip()


def now() -> str:
    """The time of day, in UTC."""
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())

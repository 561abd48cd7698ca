"""Each extra alone: what it weighs and that it works.

    python bench/extras.py [--only geometry figures] [--results bench/results/extras]

A wheel is built once. Every extra gets a virtual environment of its own, is installed from that wheel with pip, and does
the work it is there for; the sizes are those of site-packages, without pip. PyTorch is installed as the build for the CPU
(`--torch torch==2.13.0` names it), without which pip would bring CUDA. Extras that need weights do the whole work where
PSCOVER_MODELS has them.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import venv
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PHOTO = ROOT / "instances/photos/tshirts_363_color.jpg"
INSTANCE = ROOT / "instances/tiny/cliques.json"
LABELS = PHOTO.with_suffix(".labels.png")

SOLVE = "pscover solve {instance} --backend {name} --time 20"
SIMULATE = "pscover simulate --policy random --episodes 1 --most-transports 1 --quiet -o episodes"
SAM = "pscover segment {photo} --segmenter {name} --no-figure"
GUIDED = SAM.format(photo="{photo}", name="sam") + " --set-segmenter checkpoint={weights}/mobile_sam.pt"
ELLIPSE = """python -c "
import numpy, pscover
labels = numpy.zeros((80, 160), dtype=int)
labels[20:60, 10:60] = 1
print(pscover.plan(labels, required=0.6, conflicts='ellipse').status)
" """
DASK = """python -c "
from distributed import LocalCluster
if __name__ == '__main__':
    import subprocess, sys
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        sys.exit(subprocess.call(['pscover', 'simulate', '--world', 'tabletop', '--policy', 'random', '--episodes', '2',
            '--segmenter', 'truth', '--quiet', '--scheduler', cluster.scheduler_address, '-o', 'episodes']))
" """


@dataclass(frozen=True, slots=True)
class Case:
    """An extra, the work that shows it, and what that work needs beside it."""

    extra: str
    work: str
    torch: bool = False
    weights: bool = False


@dataclass(frozen=True, slots=True)
class Found:
    """What came of a case; sizes in MB, those of the bare installation left out."""

    extra: str
    megabytes: float
    packages: int
    work: str
    outcome: str


CASES = (
    Case("", SOLVE.format(instance="{instance}", name="highs")),
    *(Case(name, SOLVE.format(instance="{instance}", name=name)) for name in ("cvxpy", "pyomo", "scip", "cpsat")),
    Case("engine", SOLVE.format(instance="{instance}", name="auto")),
    Case("geometry", ELLIPSE),
    Case("figures", "pscover plan {labels} --figure plan.png"),
    Case("perception", "pscover plan {photo} --no-figure"),
    Case("plan", "pscover plan {photo} --html report.html -o plan.json"),
    Case("coco", "pscover segment {labels} --coco masks.json --no-figure"),
    Case("mobile-sam", SAM.format(photo="{photo}", name="mobile-sam"), weights=True),
    Case("sam", GUIDED, torch=True, weights=True),
    Case("models", "pscover models export {weights}/mobile_sam.pt", torch=True, weights=True),
    Case("sim", SIMULATE),
    Case("cluster", DASK),
    Case("engines", "pscover compare {instance} --backends highs,cvxpy,pyomo,scip,cpsat"),
    Case("all", "pscover plan {photo} --backend auto --figure plan.png", torch=True),
    Case("docs", "python -m mkdocs --version"),
)


def environment(folder: Path) -> Path:
    """A fresh virtual environment; its folder of programs."""
    venv.create(folder, with_pip=True, clear=True)
    return folder / "bin"


def site(programs: Path) -> Path:
    """The folder of an environment's packages."""
    return next((programs.parent / "lib").glob("python*/site-packages"))


def size(folder: Path) -> float:
    """Of the files below a folder, without pip and compiled Python, in MB."""
    skipped = ("pip", "setuptools")
    return (
        sum(
            path.lstat().st_size
            for path in folder.rglob("*")
            if path.is_file() and "__pycache__" not in path.parts and path.relative_to(folder).parts[0] not in skipped
        )
        / 1e6
    )


def wheel(folder: Path) -> Path:
    """The project's wheel, built in a folder."""
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--outdir", str(folder), str(ROOT)], check=True, capture_output=True
    )
    return next(folder.glob("*.whl"))


def measure(case: Case, built: Path, torch: str, weights: str | None) -> Found:
    """Install an extra alone and let it work."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        programs = environment(folder / "env")
        pip = [str(programs / "python"), "-m", "pip", "install", "--quiet"]
        if case.torch:
            subprocess.run([*pip, torch, "segment-anything"], check=True, capture_output=True)
        target = f"{built}[{case.extra}]" if case.extra else str(built)
        done = subprocess.run([*pip, target], capture_output=True, text=True, check=False)
        if done.returncode:
            return Found(case.extra, 0.0, 0, case.work, f"not installed: {_last(done.stderr)}")
        weight, count = size(site(programs)), len(list(site(programs).glob("*.dist-info")))
        if case.weights and weights is None:
            return Found(case.extra, weight, count, case.work, "installed; no weights to try it with")
        work = case.work.format(photo=PHOTO, instance=INSTANCE, labels=LABELS, weights=weights)
        surroundings = {
            **os.environ,
            "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
            "XDG_CACHE_HOME": str(folder / "cache"),
        }
        surroundings.pop("PYTHONPATH", None)
        done = subprocess.run(
            work, shell=True, cwd=folder, env=surroundings, capture_output=True, text=True, timeout=900, check=False
        )
        outcome = "works" if done.returncode == 0 else f"exit {done.returncode}: {_last(done.stderr)}"
        return Found(case.extra, weight, count, case.work, outcome)


def _last(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else "without a word"


def page(found: list[Found]) -> str:
    """The table as Markdown; sizes beyond the bare installation."""
    bare = next((row for row in found if not row.extra), None)
    lines = ["# Extras, each alone", ""]
    if bare:
        lines += [f"Without an extra: {bare.packages - 1} packages, {bare.megabytes:.0f} MB. An extra adds:", ""]
    lines += ["| extra | packages | MB | shown by | outcome |", "| --- | ---: | ---: | --- | --- |"]
    for row in found:
        if row.extra:
            more, weight = (
                (row.packages - bare.packages, row.megabytes - bare.megabytes) if bare else (row.packages, row.megabytes)
            )
            shown = " ".join(row.work.split()) if len(row.work) < 120 else "a short script"
            lines.append(f"| `{row.extra}` | {more} | {weight:.0f} | `{shown}` | {row.outcome} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, and write the page after each extra."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=[case.extra for case in CASES if case.extra], default=None)
    parser.add_argument("--torch", default="torch==2.13.0", help="what pip is asked for before `sam`, `models` and `all`")
    parser.add_argument("--results", type=Path, default=ROOT / "bench/results/extras")
    given = parser.parse_args()
    given.results.mkdir(parents=True, exist_ok=True)
    store = given.results / "extras.json"
    known = {row["extra"]: Found(**row) for row in json.loads(store.read_text())} if store.exists() else {}
    with tempfile.TemporaryDirectory() as folder:
        built = wheel(Path(folder))
        for case in CASES:
            if given.only is not None and case.extra not in given.only:
                continue
            row = measure(case, built, given.torch, os.environ.get("PSCOVER_MODELS"))
            known[case.extra] = row
            print(
                f"{case.extra or 'no extra':12} {row.packages:4} packages {row.megabytes:7.0f} MB  {row.outcome}", flush=True
            )
            ordered = [known[each.extra] for each in CASES if each.extra in known]
            store.write_text(json.dumps([asdict(each) for each in ordered], indent=1) + "\n")
            (given.results / "README.md").write_text(page(ordered))


if __name__ == "__main__":
    main()

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
import platform
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
COMPRESSED = """python -c "
import numpy
from pscover.perception.annotations import read_annotations, write_annotations
numpy.save('labels.npy', numpy.eye(9, dtype=int))
write_annotations(read_annotations('labels.npy'), 'masks.json', 'coco-compressed')
" """
DASK = """python -c "
from distributed import LocalCluster
if __name__ == '__main__':
    import subprocess, sys
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        sys.exit(subprocess.call(['pscover', 'simulate', '--world', 'tabletop', '--policy', 'random', '--episodes', '2',
            '--segmenter', 'truth', '--quiet', '--scheduler', cluster.scheduler_address, '-o', 'episodes']))
" """

MUJOCO = """python -c "
from pscover.sim import World, WorldSettings
from pscover.sim.mujoco_jaw import replay
from pscover.sim.wardrobe import wardrobe
world = World.of(wardrobe(0.65)[5:6], WorldSettings())
world.cloth.position[:] += (0.5, 0.3, 0.007)
assert replay(world, 0.5, 0.3, 0.0).steady
" """

HEAD = """# Extras, each alone

Measured by `python bench/extras.py` under Python {python} on {system}, each in an environment of its own. MB are those of
site-packages, without pip and compiled Python; extras share packages, so that sums say too much. `sam`, `models` and `all`
got PyTorch's build for the CPU, without which pip brings gigabytes of CUDA."""
FOOT = """`instance.json` is instances/tiny/cliques.json, `photo.jpg` is instances/photos/tshirts_363_color.jpg, `labels.png`
its labels; `weights` holds MobileSAM's weights, which the project does not ship (PSCOVER_MODELS says where they are)."""


@dataclass(frozen=True, slots=True)
class Case:
    """An extra, the work that shows it, what the table calls that work, and what it needs beside the extra."""

    extra: str
    work: str
    called: str = ""
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
    Case("geometry", ELLIPSE, called='`plan(labels, conflicts="ellipse")`'),
    Case("figures", "pscover plan {labels} --figure plan.png"),
    Case("perception", "pscover plan {photo} --no-figure"),
    Case("plan", "pscover plan {photo} --html report.html -o plan.json"),
    Case("coco", COMPRESSED, called='`write_annotations(masks, "masks.json", "coco-compressed")`'),
    Case("mobile-sam", SAM.format(photo="{photo}", name="mobile-sam"), weights=True),
    Case("sam", GUIDED, torch=True, weights=True),
    Case("models", "pscover models export {weights}/mobile_sam.pt", torch=True, weights=True),
    Case("sim", SIMULATE),
    Case("mujoco", MUJOCO, called="`pscover.sim.mujoco_jaw.replay`, a glove in MuJoCo"),
    Case("cluster", DASK, called="`pscover simulate --scheduler ADDRESS`, beside a Dask cluster of one worker"),
    Case("engines", "pscover compare {instance} --backends highs,cvxpy,pyomo,scip,cpsat"),
    Case("all", "pscover plan {photo} --backend auto --figure plan.png", torch=True),
    Case("docs", "NO_MKDOCS_2_WARNING=1 mkdocs build --quiet --strict --config-file {root}/mkdocs.yml --site-dir $PWD/site"),
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
    """The project's wheel, built in a folder; by way of the sdist, which leaves no build/ in the checkout."""
    subprocess.run([sys.executable, "-m", "build", "--outdir", str(folder), str(ROOT)], check=True, capture_output=True)
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
        work = case.work.format(photo=PHOTO, instance=INSTANCE, labels=LABELS, weights=weights, root=ROOT)
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
    lines = [HEAD.format(python=platform.python_version(), system=platform.system()), ""]
    if bare:
        lines += [f"Without an extra: {bare.packages - 1} packages, {bare.megabytes:.0f} MB. An extra adds:", ""]
    lines += ["| extra | packages | MB | shown by | outcome |", "| --- | ---: | ---: | --- | --- |"]
    for case in CASES:
        for row in (row for row in found if row.extra == case.extra != ""):
            more, weight = (
                (row.packages - bare.packages, row.megabytes - bare.megabytes) if bare else (row.packages, row.megabytes)
            )
            lines.append(f"| `{row.extra}` | {more} | {weight:.0f} | {_called(case)} | {row.outcome} |")
    lines += ["", FOOT]
    return "\n".join(lines) + "\n"


def _called(case: Case) -> str:
    names = {"photo": "photo.jpg", "labels": "labels.png", "instance": "instance.json", "weights": "weights", "root": "."}
    return case.called or f"`{case.work.format(**names)}`"


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

"""Grasps in the world of cloth and in MuJoCo: do both lift the same garments?

python bench/mujoco_check.py --cache scenes/           # 30 grasps; goes on where it was stopped; draws the page anew
python bench/mujoco_check.py --nudge --cache scenes/   # and what decides in our world
python bench/mujoco_check.py --page                    # the page alone

Ten scenes as experiments make them (`World.scene`), three grasps a scene, each on the untouched scene: in the middle of a
garment, on a border between two, and at the rim of one, where the jaw may miss. `results/mujoco/results.jsonl` has a line
a grasp. `--nudge` repeats each grasp in our world alone: 3 mm beside its place (`nudged`), and from where cloth comes to
rest in MuJoCo (`rested`). Needs the extra `mujoco`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from mujoco_grasps import KINDS, Grasp, Kind, place
from scipy.stats import binomtest

from pscover.evidence.sweep import Done, Store, Sweep, run_sweep
from pscover.experiment.agreement import Confusion, jaccard, over_groups, wilson
from pscover.experiment.statistics import Interval, bootstrap
from pscover.files import write_bytes
from pscover.sim import World, WorldSettings
from pscover.sim.bank import version
from pscover.sim.cloth import FloatArray
from pscover.sim.fingers import COSINE, GAP, SINE, X, Y, Z
from pscover.sim.held import Jaw, held, reached, risen
from pscover.sim.mujoco_jaw import Shell, replay, rested
from pscover.sim.wardrobe import wardrobe

SCENES = 10
NUDGES = ((3.0, 0.0), (-3.0, 0.0))
"""Millimetres along x and y."""
RESULTS = Path(__file__).parent / "results/mujoco"


@dataclass(frozen=True, slots=True, kw_only=True)
class Lifted:
    """What a grasp lifted, by garment.

    Parameters
    ----------
    held
        By the criterion of `pscover.sim.held`.
    risen
        By its second half alone: garments that hang at others count, too.
    gap
        Millimetres between the pads.
    """

    held: tuple[int, ...]
    risen: tuple[int, ...]
    gap: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What came of a grasp.

    Parameters
    ----------
    x, y, theta
        Metres and radians.
    reached
        Garments that the open jaw may meet.
    simulated, particles
        Garments in MuJoCo, and of how many particles.
    ours, mujoco
        What each world lifted.
    gripped
        What our world itself takes for held.
    settled
        Millimetres, in the mean square, by which cloth moved in MuJoCo before the fingers came.
    steady
        Whether MuJoCo gave no warning.
    """

    x: float
    y: float
    theta: float
    reached: tuple[int, ...]
    simulated: tuple[int, ...]
    particles: int
    ours: Lifted
    mujoco: Lifted
    gripped: tuple[int, ...]
    settled: float
    steady: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Seconds:
    """CPU seconds of each world, the scene's making left out."""

    ours: float
    mujoco: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Nudge:
    """A grasp some millimetres beside its place."""

    scene: int
    kind: Kind
    x: float
    y: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """Garments that were held by the criterion."""

    held: tuple[int, ...]


def close_and_lift(world: World, x: float, y: float, theta: float) -> Jaw:
    """The grasp in our world; where the jaw is then."""
    world.arm.close_at(x, y, theta)
    world.arm.lift(world.settings.gripper.lift)
    state = world.arm.hand.state
    angle = float(np.arctan2(state[SINE], state[COSINE]))
    return Jaw(x=float(state[X]), y=float(state[Y]), z=float(state[Z]), theta=angle, gap=float(state[GAP]))


def compared(cache: Path | None) -> Callable[[Grasp], Done[Row, Seconds]]:
    """Makes a grasp in both worlds; scenes are kept in a folder."""

    def run(grasp: Grasp) -> Done[Row, Seconds]:
        world = World.scene(grasp.scene, cache=cache)
        cloth, gripper = world.cloth, world.settings.gripper
        x, y, theta = place(world, grasp.kind)
        before = cloth.position.copy()
        within = reached(cloth, Jaw(x=x, y=y, z=gripper.tip, theta=theta, gap=gripper.opening), gripper)

        def lifted(after: FloatArray, jaw: Jaw) -> Lifted:
            return Lifted(
                held=held(cloth, before, after, jaw, gripper),
                risen=risen(cloth, before, after),
                gap=round(1000 * jaw.gap, 1),
            )

        began = time.process_time()
        other = replay(world, x, y, theta)
        between = time.process_time()
        jaw = close_and_lift(world, x, y, theta)
        ended = time.process_time()
        there = np.isin(cloth.garment, other.garments)
        moved = np.square(other.rest - before)[there].sum(axis=1)
        row = Row(
            x=x,
            y=y,
            theta=theta,
            reached=within,
            simulated=other.garments,
            particles=int(there.sum()),
            ours=lifted(cloth.position, jaw),
            mujoco=lifted(other.after, other.jaw),
            gripped=world.arm.held,
            settled=round(1000 * float(np.sqrt(moved.mean())), 1) if there.any() else 0.0,
            steady=other.steady,
        )
        return Done(row=row, timing=Seconds(ours=round(ended - between, 2), mujoco=round(between - began, 2)))

    return run


def sweep(cache: Path | None) -> Sweep[Grasp, Row, Seconds]:
    """All grasps of the check."""
    return Sweep(
        name="mujoco",
        run=compared(cache),
        case=Grasp,
        row=Row,
        timing=Seconds,
        settings=_settings(),
    )


def nudged(cache: Path | None) -> Callable[[Nudge], Done[Held, float]]:
    """Makes a grasp a little beside its place, in our world."""

    def run(nudge: Nudge) -> Done[Held, float]:
        world = World.scene(nudge.scene, cache=cache)
        x, y, theta = place(world, nudge.kind)
        before, began = world.cloth.position.copy(), time.process_time()
        jaw = close_and_lift(world, x + nudge.x / 1000, y + nudge.y / 1000, theta)
        seconds = time.process_time() - began
        row = Held(held=held(world.cloth, before, world.cloth.position, jaw, world.settings.gripper))
        return Done(row=row, timing=round(seconds, 2))

    return run


def nudges(cache: Path | None) -> Sweep[Nudge, Held, float]:
    """Grasps beside those of the check."""
    return Sweep(name="nudged", run=nudged(cache), case=Nudge, row=Held, timing=float, settings=_settings())


def from_rest(cache: Path | None) -> Callable[[Grasp], Done[Held, float]]:
    """Makes a grasp in our world on cloth that lies as it comes to rest in MuJoCo."""

    def run(grasp: Grasp) -> Done[Held, float]:
        world = World.scene(grasp.scene, cache=cache)
        x, y, theta = place(world, grasp.kind)
        began, cloth = time.process_time(), world.cloth
        before = rested(world, x, y)
        cloth.position[:] = cloth.before[:] = cloth.anchor[:] = before
        jaw = close_and_lift(world, x, y, theta)
        row = Held(held=held(cloth, before, cloth.position, jaw, world.settings.gripper))
        return Done(row=row, timing=round(time.process_time() - began, 2))

    return run


def rests(cache: Path | None) -> Sweep[Grasp, Held, float]:
    """The grasps of the check, from MuJoCo's rest."""
    return Sweep(name="rested", run=from_rest(cache), case=Grasp, row=Held, timing=float, settings=_settings())


def _settings() -> dict[str, object]:
    return {"shell": asdict(Shell()), "world": version(WorldSettings())}


def grasps(scenes: int) -> list[Grasp]:
    """Each kind on each scene."""
    return [Grasp(scene=scene, kind=kind) for scene in range(scenes) for kind in KINDS]


def beside(made: Sequence[Grasp]) -> list[Nudge]:
    """Each nudge of each grasp."""
    return [Nudge(scene=grasp.scene, kind=grasp.kind, x=x, y=y) for grasp in made for x, y in NUDGES]


def table(row: Row) -> Confusion:
    """Of the garments in the jaw's reach, and those held by either though out of it."""
    among = {*row.reached, *row.ours.held, *row.mujoco.held}
    return Confusion.of(row.ours.held, row.mujoco.held, among)


def _span(interval: Interval) -> str:
    return f"{interval.mean:.2f} ({interval.low:.2f}–{interval.high:.2f})"


def _measures(rows: dict[Grasp, Row]) -> list[str]:
    """A line of the first table."""
    scenes = sorted({grasp.scene for grasp in rows})
    by_scene = [[table(row) for grasp, row in rows.items() if grasp.scene == scene] for scene in scenes]
    whole = Confusion.sum([one for group in by_scene for one in group])
    same = sum(row.ours.held == row.mujoco.held for row in rows.values())
    shared = [np.mean([jaccard(r.ours.held, r.mujoco.held) for g, r in rows.items() if g.scene == s]) for s in scenes]
    return [
        f"{len(rows)}",
        f"{same}: {_span(wilson(same, len(rows)))}",
        f"{whole.agreed} of {whole.total}: {_span(wilson(whole.agreed, whole.total))}",
        _span(over_groups(by_scene, lambda one: one.kappa, samples=2000)),
        _span(bootstrap([float(value) for value in shared])),
        f"{whole.both} / {whole.first} / {whole.second} / {whole.neither}",
    ]


def _numbers(rows: dict[Grasp, Row]) -> list[str]:
    """How many garments each world lifts."""
    ours, mujoco = [len(row.ours.held) for row in rows.values()], [len(row.mujoco.held) for row in rows.values()]
    whole = Confusion.sum([table(row) for row in rows.values()])
    alone = whole.first + whole.second
    chance = f" (sign test: p = {binomtest(whole.first, alone).pvalue:.2f})" if alone else ""
    several, others = (sum(count > 1 for count in counts) for counts in (ours, mujoco))
    return [
        f"- Garments a grasp: ours {np.mean(ours):.2f}, MuJoCo {np.mean(mujoco):.2f}; two or more at once in {several} and",
        f"  {others} grasps; held in one world alone: {whole.first} in ours, {whole.second} in MuJoCo{chance}.",
    ]


def _spent(seconds: Sequence[float]) -> str:
    return f"{np.mean(seconds):.1f} (most {max(seconds):.1f}, all {sum(seconds) / 60:.1f} minutes)"


def _named(garments: Sequence[int], names: Sequence[str]) -> str:
    return ", ".join(names[g] for g in garments) or "–"


def _sure(rows: dict[Grasp, Row], tried: Sequence[tuple[str, Sequence[tuple[Grasp, Held]]]]) -> list[str]:
    """How often our world holds the same set when something little is different."""
    lines = ["| our world | where the worlds | grasps | its own set | MuJoCo's set |", "| --- | --- | ---: | ---: | ---: |"]
    for what, outcomes in tried:
        for same in (True, False):
            both = [(rows[grasp], found.held) for grasp, found in outcomes if grasp in rows]
            both = [(row, now) for row, now in both if same == (row.ours.held == row.mujoco.held)]
            own, other = sum(now == row.ours.held for row, now in both), sum(now == row.mujoco.held for row, now in both)
            lines.append(f"| {what} | {'agree' if same else 'differ'} | {len(both)} | {own} | {other} |")
    return [*lines, ""]


def page(
    store: Store[Grasp, Row, Seconds],
    nudged: Store[Nudge, Held, float],
    rested: Store[Grasp, Held, float],
    names: Sequence[str],
) -> str:
    """The tables as Markdown."""
    cases = sorted(store.cases, key=lambda grasp: (grasp.scene, KINDS.index(grasp.kind)))
    rows = {grasp: row for grasp in cases if (row := store.row(grasp)) is not None}
    seconds = [timing for grasp in cases if (timing := store.timing(grasp)) is not None]
    beside_it = [
        (Grasp(scene=one.scene, kind=one.kind), near) for one in nudged.cases if (near := nudged.row(one)) is not None
    ]
    from_its_rest = [(grasp, now) for grasp in rested.cases if (now := rested.row(grasp)) is not None]
    lines = [
        "| grasps | how many | same set | garments agreed on | kappa | Jaccard | held by both / ours / MuJoCo / neither |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
        "| all | " + " | ".join(_measures(rows)) + " |",
    ]
    for kind in KINDS:
        own = {grasp: row for grasp, row in rows.items() if grasp.kind == kind}
        if own:
            lines.append(f"| {kind} | " + " | ".join(_measures(own)) + " |")
    particles, settled = [row.particles for row in rows.values()], [row.settled for row in rows.values()]
    kept = sum(row.ours.held == row.gripped for row in rows.values())
    warned = sum(not row.steady for row in rows.values())
    lines += [
        "",
        *_numbers(rows),
        f"- CPU seconds a grasp: ours {_spent([one.ours for one in seconds])},",
        f"  MuJoCo {_spent([one.mujoco for one in seconds])}.",
        f"- Particles in MuJoCo: {min(particles)} to {max(particles)}.",
        f"- Our world itself takes the same garments for held as the criterion in {kept} of {len(rows)} grasps.",
        f"- Cloth moved in MuJoCo before the fingers came: {np.median(settled):.0f} mm in the root mean square over the",
        f"  garments of a grasp (median over grasps; most {max(settled):.0f}).",
        f"- Grasps in which MuJoCo warned of something: {warned}.",
        "",
        *_sure(rows, [("3 mm beside", beside_it), ("from MuJoCo's rest", from_its_rest)]),
        "| scene | grasp | in reach | ours | MuJoCo | same | also risen: ours / MuJoCo |",
        "| ---: | --- | --- | --- | --- | --- | --- |",
    ]
    for grasp, row in rows.items():
        also = [_named(sorted(set(one.risen) - set(one.held)), names) for one in (row.ours, row.mujoco)]
        cells = (
            f"{grasp.scene}",
            grasp.kind,
            _named(row.reached, names),
            _named(row.ours.held, names),
            _named(row.mujoco.held, names),
            "yes" if row.ours.held == row.mujoco.held else "**no**",
            " / ".join(also),
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run what is missing, then draw the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=SCENES)
    parser.add_argument("--cache", type=Path, help="an existing folder where scenes are kept")
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--page", action="store_true", help="run nothing")
    parser.add_argument("--nudge", action="store_true", help="also grasp beside, in our world")
    asked = parser.parse_args()
    store = Store(asked.results, sweep(asked.cache))
    near = Store(asked.results / "nudged", nudges(asked.cache))
    rest = Store(asked.results / "rested", rests(asked.cache))

    def told(case: object, row: object) -> None:
        print(case, row, flush=True)

    def one() -> ThreadPoolExecutor:
        return ThreadPoolExecutor(1)

    cases = grasps(asked.scenes)
    if not asked.page:
        run_sweep(store, cases, one, told)
    if asked.nudge:
        run_sweep(rest, cases, one, told)
        run_sweep(near, beside(cases), one, told)
    write_bytes(asked.results / "table.md", page(store, near, rest, [garment.name for garment in wardrobe()]).encode())


if __name__ == "__main__":
    main()

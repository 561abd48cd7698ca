"""The paper's Table 2, its numbers beside ours, and what comes after 35 garments; and the third experiment, by groups."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pscover.evidence.growth import FULL, Case, Seen, Took
from pscover.evidence.sweep import Store
from pscover.evidence.tables import NOTHING, Table, interval, number
from pscover.experiment.statistics import Interval, bootstrap

CLASSICAL = "classical"
FEW = 5
"""Fewer seeds than this are too few for the bootstrap."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """A column of the paper's Table 2: segments found, seconds of segmentation and of the MILP, on the authors' machine."""

    segments: int
    segmentation: float
    milp: float


PAPER = {
    5: Published(segments=4, segmentation=19.66, milp=1.43),
    10: Published(segments=9, segmentation=18.86, milp=3.88),
    15: Published(segments=14, segmentation=18.74, milp=6.73),
    20: Published(segments=19, segmentation=18.73, milp=9.95),
    25: Published(segments=24, segmentation=18.72, milp=13.42),
    30: Published(segments=29, segmentation=18.81, milp=16.86),
    35: Published(segments=35, segmentation=18.70, milp=22.27),
}
"""By garments: Adler et al. 2023, Table 2."""
SIZES = tuple(PAPER)
BEYOND = (50, 100, 200, 500, 1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """CPU seconds of one stage over the seeds of a line.

    Parameters
    ----------
    seconds
        Those of the seeds that were not cut off, in the order of the seeds.
    mean
        Their mean with its interval.
    cut_off, refuted
        How many seeds ended at the limit, and in how many it was proven that there is no plan.
    limit
        The most seconds that any seed took.
    """

    seconds: dict[int, float]
    mean: Interval
    cut_off: int = 0
    refuted: int = 0
    limit: float = math.nan

    def __str__(self) -> str:
        """The mean with its interval, or what is known where a seed was cut off."""
        if not self.cut_off:
            return interval(self.mean, len(self.seconds))
        total = self.cut_off + len(self.seconds)
        return f"> {number(self.limit)} ({self.cut_off} of {total} cut off)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """The scenes of one size, or of one number of groups, over their seeds.

    Parameters
    ----------
    garments, groups, seeds
        Which scenes, and how many.
    segments, candidates, out_of_reach
        Means over seeds.
    stages
        "segmentation", "candidates" and the engines, by name.
    """

    garments: int
    groups: int
    seeds: int
    segments: Interval
    candidates: Interval
    out_of_reach: float
    stages: dict[str, Column]


def lines(store: Store[Case, Seen, Took], segmenter: str = CLASSICAL) -> list[Line]:
    """One a size and number of groups, of the scenes that this segmenter looked at, in ascending order."""
    found: dict[tuple[int, int], dict[int, Case]] = {}
    for case in store.cases:
        if case.segmenter == segmenter:
            found.setdefault((case.garments, case.groups), {})[case.seed] = case
    return [_line(store, [by_seed[seed] for seed in sorted(by_seed)]) for _, by_seed in sorted(found.items())]


def _line(store: Store[Case, Seen, Took], cases: Sequence[Case]) -> Line:
    rows = [row for case in cases if (row := store.row(case)) is not None]
    took = {case.seed: timing for case in cases if (timing := store.timing(case)) is not None}
    stages = {
        "segmentation": _column({seed: timing.segmentation for seed, timing in took.items()}),
        "candidates": _column({seed: timing.candidates for seed, timing in took.items()}),
    }
    for engine in dict.fromkeys(run.engine for timing in took.values() for run in timing.runs):
        runs = {seed: run for seed, timing in took.items() for run in timing.runs if run.engine == engine}
        stages[engine] = _column(
            {seed: run.seconds for seed, run in runs.items() if not run.is_cut_off},
            cut_off=sum(run.is_cut_off for run in runs.values()),
            refuted=sum(run.status == "infeasible" for run in runs.values()),
            limit=max(run.seconds for run in runs.values()),
        )
    return Line(
        garments=cases[0].garments,
        groups=cases[0].groups,
        seeds=len(rows),
        segments=bootstrap([row.segments for row in rows]),
        candidates=bootstrap([row.candidates for row in rows]),
        out_of_reach=float(np.mean([row.out_of_reach for row in rows])),
        stages=stages,
    )


def _column(seconds: dict[int, float], cut_off: int = 0, refuted: int = 0, limit: float = math.nan) -> Column:
    mean = bootstrap(list(seconds.values()))
    return Column(seconds=seconds, mean=mean, cut_off=cut_off, refuted=refuted, limit=limit)


def exponent(found: Sequence[Line], stage: str) -> Interval:
    """b of seconds = a garments^b, by least squares of the logarithms, a seed at a time; NaN for fewer than three sizes.

    Only sizes at which no seed was cut off count; the interval is over seeds.
    """
    known = [line for line in found if stage in line.stages and not line.stages[stage].cut_off]
    if len(known) < 3:
        return bootstrap([])
    seeds = set.intersection(*(set(line.stages[stage].seconds) for line in known))
    size = np.log([line.garments for line in known])
    return bootstrap(
        [
            float(np.polyfit(size, np.log([line.stages[stage].seconds[seed] for line in known]), 1)[0])
            for seed in sorted(seeds)
        ]
    )


def published_exponent() -> float:
    """That of the MILP in the paper's table.

    Examples
    --------
    >>> round(published_exponent(), 2)
    1.39
    """
    return float(np.polyfit(np.log(list(PAPER)), np.log([paper.milp for paper in PAPER.values()]), 1)[0])


def stages_of(found: Iterable[Line]) -> list[str]:
    """All stages that a line has, in the order in which they come."""
    return list(dict.fromkeys(stage for line in found for stage in line.stages))


def size_table(found: Sequence[Line], limit: float, others: Mapping[str, Sequence[Line]] | None = None) -> Table:
    """Table 2 and beyond.

    Parameters
    ----------
    found
        Lines of scenes without groups.
    limit
        CPU seconds that an engine had.
    others
        Lines by other segmenters, of which segments and seconds are shown beside.
    """
    stages = stages_of(found)
    besides = {name: {line.garments: line for line in given} for name, given in (others or {}).items()}
    columns = ["garments", "seeds", "segments found", "segmentation s", "candidates", "candidates s"]
    columns += [f"{stage.replace('/', ' ')} s" for stage in stages[2:]]
    columns += [text for name in besides for text in (f"{name}: segments", f"{name}: s")]
    columns += ["paper: segments", "paper: segmentation s", "paper: MILP s"]
    rows = []
    for line in found:
        cells = [str(line.garments), str(line.seeds), *_head(line), *(_cell(line, stage) for stage in stages[2:])]
        for by_size in besides.values():
            other = by_size.get(line.garments)
            if other is None:
                cells += [NOTHING] * 2
            else:
                cells += [interval(other.segments, other.seeds), str(other.stages["segmentation"])]
        paper = PAPER.get(line.garments)
        cells += [NOTHING] * 3 if paper is None else [str(paper.segments), number(paper.segmentation), number(paper.milp)]
        rows.append(tuple(cells))
    return Table(
        name="table2",
        title="Table 2: time against garments",
        columns=tuple(columns),
        rows=tuple(rows),
        notes=(*_notes(found, limit), "The paper's seconds are those of its authors' machine, and no seconds of ours."),
    )


def growth_table(found: Sequence[Line]) -> Table:
    """How each stage grows, up to the paper's largest scene and from there on."""
    parts = (
        (f"up to {FULL} garments", [line for line in found if line.garments <= FULL]),
        (f"from {FULL} garments on", [line for line in found if line.garments >= FULL]),
    )
    rows = []
    for stage in stages_of(found):
        cells = []
        for _, part in parts:
            fitted = exponent(part, stage)
            cells.append(interval(fitted, len(part[0].stages[stage].seconds) if part and stage in part[0].stages else 0))
        rows.append((stage.replace("/", " "), *cells))
    rows.append(("MILP of the paper", number(published_exponent()), NOTHING))
    return Table(
        name="growth",
        title="Growth: the exponent b of seconds = a · garments^b",
        columns=("stage", *(name for name, _ in parts)),
        rows=tuple(rows),
        text_columns=frozenset({"stage"}),
        notes=(
            "Least squares of logarithms, a seed at a time; mean over seeds with its 95 % interval by the bootstrap. "
            "Only sizes at which no seed was cut off; fewer than three give no exponent.",
        ),
    )


def group_table(found: Sequence[Line], limit: float) -> Table:
    """The third experiment: times against the number of groups."""
    stages = stages_of(found)
    columns = ["groups", "seeds", "segments found", "segmentation s", "candidates", "candidates s"]
    columns += [f"{stage.replace('/', ' ')} s" for stage in stages[2:]]
    rows = [
        (str(line.groups), str(line.seeds), *_head(line), *(_cell(line, stage) for stage in stages[2:])) for line in found
    ]
    count = found[0].garments if found else FULL
    return Table(
        name="groups",
        title=f"Third experiment: {count} garments, of which more and more overlap",
        columns=tuple(columns),
        rows=tuple(rows),
        notes=(
            *_notes(found, limit),
            "Groups of three garments, any two of which overlap. The paper saw no clear relation to either time, and gives "
            "no numbers.",
        ),
    )


def trend_table(found: Sequence[Line]) -> Table:
    """Whether times grow with the groups: the slope of seconds against groups, relative to the mean."""
    rows = []
    for stage in stages_of(found):
        cut = sum(line.stages[stage].cut_off for line in found if stage in line.stages)
        slope = trend(found, stage)
        rows.append((stage.replace("/", " "), interval(slope, found[0].seeds if found else 0), str(cut)))
    return Table(
        name="groups-trend",
        title="Third experiment: change of each time per further group",
        columns=("stage", "% of its mean per group", "runs cut off"),
        rows=tuple(rows),
        text_columns=frozenset({"stage"}),
        notes=("A straight line through each seed's seconds; mean over seeds with its 95 % interval by the bootstrap.",),
    )


def trend(found: Sequence[Line], stage: str) -> Interval:
    """Percent of its mean by which a stage's time changes with a further group; NaN for fewer than three lines."""
    known = [line for line in found if stage in line.stages]
    if len(known) < 3:
        return bootstrap([])
    seeds = sorted(set.union(*(set(line.stages[stage].seconds) for line in known)))
    slopes = []
    for seed in seeds:
        own = [(line.groups, line.stages[stage].seconds[seed]) for line in known if seed in line.stages[stage].seconds]
        if len(own) >= 3:
            groups, seconds = np.array(own).T
            slopes.append(100 * float(np.polyfit(groups, seconds, 1)[0]) / float(seconds.mean()))
    return bootstrap(slopes)


def _head(line: Line) -> tuple[str, str, str, str]:
    return (
        interval(line.segments, line.seeds),
        str(line.stages["segmentation"]),
        number(line.candidates.mean),
        str(line.stages["candidates"]),
    )


def _cell(line: Line, stage: str) -> str:
    return str(line.stages[stage]) if stage in line.stages else "left out"


def _notes(found: Sequence[Line], limit: float) -> tuple[str, ...]:
    seeds = sorted({line.seeds for line in found})
    several = " to ".join(dict.fromkeys(map(str, (seeds[0], seeds[-1])))) if seeds else "0"
    few = ", of which so few seeds give little more than the range" if seeds and seeds[0] < FEW else ""
    out = sum(line.out_of_reach * line.seeds for line in found)
    total = sum(line.segments.mean * line.seeds for line in found)
    refuted = sum(column.refuted for line in found for column in line.stages.values())
    notes = [
        "Seconds are CPU seconds of all threads and processes of a stage, one thread asked for, everything imported, "
        f"loaded and compiled before; an engine's are those from its call to the checked plan, {limit:g} at most.",
        f"Means over {several} seeds with 95 % intervals by the bootstrap over seeds{few}.",
        f"{out:.0f} of {total:.0f} garments seen are out of reach of a required probability of 0.7 and asked for no more.",
    ]
    if refuted:
        notes.append(f"In {refuted} runs it was proven that no plan exists.")
    if any(stage not in line.stages for line in found for stage in stages_of(found)):
        notes.append("left out: the engine was cut off at a smaller size.")
    return tuple(notes)

"""Results as JSON. What is infinite is null: no time limit, no plan yet, no bound; a bound of plus infinity is "inf".

The JSON Schema of the document (`ResultV1`) is `instances/schema/result-1.json`.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from pscover.certificate import MOST_SCALE, Certificate
from pscover.errors import InvalidResult, InvalidSettings
from pscover.files import TEXT_LIMIT, read_bytes, write_bytes
from pscover.infeasibility import Diagnosis, Unmet, Unreachable
from pscover.instance import INDEX_LIMIT
from pscover.io.documents import Versions
from pscover.proof import MOST_COUNT, MOST_DEPTH, Part, Parts, Prices, Proof, Split, Sweep
from pscover.relaxation import HUGE, MOST_UNITS
from pscover.result import Progress, Result, Settings, Status, Stop, Timing

Index = Annotated[int, msgspec.Meta(ge=0, le=INDEX_LIMIT)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Amount = Annotated[float, msgspec.Meta(ge=0)]
Bound = float | Literal["inf"] | None
Whole = Annotated[int, msgspec.Meta(ge=-HUGE, le=HUGE)]
Sorted = Annotated[list[Index], msgspec.Meta(description="strictly increasing")]


class SettingsV1(Struct, forbid_unknown_fields=True):
    """How the instance was solved; `time` is null without a limit."""

    time: float | None
    gap: float
    threads: int
    seed: int
    margin: float
    start: list[Index] | None


class ProgressV1(Struct, forbid_unknown_fields=True):
    """One improvement; `objective` is null without a plan, `bound` without a bound, `chosen` without a new plan."""

    seconds: Amount
    objective: float | None
    bound: Bound
    chosen: Sorted | None


class TimingV1(Struct, forbid_unknown_fields=True):
    """Wall seconds by stage."""

    build: Amount
    engine: Amount
    check: Amount
    total: Amount


class UnreachableV1(Struct, forbid_unknown_fields=True):
    """An element that no plan covers often enough."""

    element: Index
    required: Share
    reach: Share
    ceiling: Amount
    cliques: list[Index]


class UnmetV1(Struct, forbid_unknown_fields=True):
    """An element left short by the plan with the fewest unmet requirements."""

    element: Index
    required: Share
    coverage: Share
    cliques: list[Index]


class DiagnosisV1(Struct, forbid_unknown_fields=True):
    """Why there is no plan."""

    unreachable: list[UnreachableV1]
    unmet: list[UnmetV1]


class PricesV1(Struct, tag="prices", forbid_unknown_fields=True):
    """What elements pay for each stored probability, candidate after candidate, and for a unit of demand."""

    entry: list[Whole]
    unit: list[Whole]


class SweepV1(Struct, tag="sweep", forbid_unknown_fields=True):
    """Elements solved together, in an order; `limit` is the bound asked for, null for whether there is a plan."""

    entry: list[Whole]
    order: list[Index]
    limit: Whole | None


class SplitV1(Struct, tag="split", forbid_unknown_fields=True):
    """Plans with at most `count` candidates of an element, and plans with more."""

    element: Index
    count: Annotated[int, msgspec.Meta(ge=0, le=MOST_COUNT)]
    few: ProofV1
    many: ProofV1


class PartV1(Struct, forbid_unknown_fields=True):
    """Some elements, what is charged there for some candidates, and a proof for these elements alone."""

    elements: Sorted
    charged: Sorted
    charge: list[Whole]
    proof: ProofV1


class PartsV1(Struct, tag="parts", forbid_unknown_fields=True):
    """Elements divided: the bounds of all parts add up."""

    parts: Annotated[list[PartV1], msgspec.Meta(min_length=1)]


ProofV1 = PricesV1 | SweepV1 | SplitV1 | PartsV1


class CertificateV1(Struct, forbid_unknown_fields=True):
    """What proves a lower bound; see `pscover.certificate`."""

    units: Annotated[int, msgspec.Meta(ge=1, le=MOST_UNITS)]
    scale: Annotated[int, msgspec.Meta(ge=1, le=MOST_SCALE)]
    proof: ProofV1


class ResultV1(Struct, tag_field="schema", tag="pscover.result/1", forbid_unknown_fields=True):
    """What was found, and how good it is; see `pscover.result.Result`."""

    status: Status
    stop: Stop
    chosen: Sorted | None
    value: list[float]
    bound: Bound
    coverage: list[Share] | None
    shortfall: list[Amount] | None
    backend: str
    formulation: str
    options: str
    settings: SettingsV1
    digest: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]
    versions: list[tuple[str, str]]
    timing: TimingV1
    message: str = ""
    diagnosis: DiagnosisV1 | None = None
    trace: list[ProgressV1] = []
    certificate: CertificateV1 | None = None


RESULT_VERSIONS = Versions(newest=ResultV1, old=(), error=InvalidResult)


def load_result(path: str | os.PathLike[str]) -> Result:
    """Read a result from a JSON file that may hold anything.

    Raises
    ------
    InvalidResult
        With the file, the path in the document, what was expected and what was found.
    """
    path = Path(path)
    try:
        return decode(read_bytes(path, TEXT_LIMIT, InvalidResult), path)
    except MemoryError:
        raise InvalidResult(f"{path}: reading it takes more memory than there is") from None


def save_result(result: Result, path: str | os.PathLike[str]) -> None:
    """Write a result to a JSON file; reading it gives an equal result.

    Raises
    ------
    InvalidResult
        If the result holds something that is no number or no text.
    PscoverError
        If the file cannot be written.
    """
    write_bytes(path, encode(result))


def decode(content: bytes, source: str | Path = "JSON") -> Result:
    """A result from JSON text in UTF-8; errors as `load_result`."""
    document = RESULT_VERSIONS.decode(content, source)
    RESULT_VERSIONS.require_unique_keys(content, source)
    _check(document, source)
    given = document.settings
    try:
        settings = Settings(
            time=math.inf if given.time is None else given.time,
            gap=given.gap,
            threads=given.threads,
            seed=given.seed,
            margin=given.margin,
            start=None if given.start is None else tuple(given.start),
        )
    except InvalidSettings as error:
        raise InvalidResult(f"{source}: $.settings.{error}") from None
    return Result(
        status=document.status,
        stop=document.stop,
        chosen=_indices(document.chosen),
        value=tuple(document.value),
        bound=_bound(document.bound),
        coverage=_floats(document.coverage),
        shortfall=_floats(document.shortfall),
        backend=document.backend,
        formulation=document.formulation,
        options=document.options,
        settings=settings,
        digest=document.digest,
        versions=tuple(document.versions),
        timing=Timing(**msgspec.structs.asdict(document.timing)),
        trace=tuple(_progress(step) for step in document.trace),
        message=document.message,
        diagnosis=None if document.diagnosis is None else _diagnosis(document.diagnosis),
        certificate=None if document.certificate is None else _certificate(document.certificate, source),
    )


def encode(result: Result) -> bytes:
    """A result as indented JSON text in UTF-8, every number exact; errors as `save_result`."""
    settings = msgspec.to_builtins(result.settings)
    settings["time"] = _or_null("settings.time", result.settings.time, math.inf)
    diagnosis = None if result.diagnosis is None else msgspec.to_builtins(result.diagnosis)
    content = {
        "schema": str(ResultV1.__struct_config__.tag),
        "status": str(result.status),
        "stop": str(result.stop),
        "chosen": _listed(result.chosen),
        "value": [float(v) for v in result.value],
        "bound": _bound_or_null("bound", result.bound),
        "coverage": _listed(result.coverage),
        "shortfall": _listed(result.shortfall),
        "backend": result.backend,
        "formulation": result.formulation,
        "options": result.options,
        "settings": settings,
        "digest": result.digest,
        "versions": [list(pair) for pair in result.versions],
        "timing": msgspec.to_builtins(result.timing),
        "message": result.message,
        "diagnosis": diagnosis,
        "trace": [_step(k, step) for k, step in enumerate(result.trace)],
        "certificate": None if result.certificate is None else _certified(result.certificate),
    }
    try:
        text = msgspec.json.encode(content)
        # A result that could not be read again (NaN in its numbers) must not be written.
        msgspec.json.decode(text, type=ResultV1)
    except UnicodeEncodeError as error:
        raise InvalidResult(f"expected text in Unicode, got {error.object!r}") from None
    except (msgspec.ValidationError, TypeError, OverflowError) as error:
        raise InvalidResult(f"this result cannot be kept in a file: {error}") from None
    # Whole numbers side by side: no line break is inside a text.
    laid = re.sub(rb"\[\n[-0-9,\s]+\]", lambda found: b" ".join(found[0].split()), msgspec.json.format(text, indent=1))
    return laid + b"\n"


def _check(document: ResultV1, source: str | Path) -> None:
    """Parts that contradict each other."""
    for place, indices in [
        ("$.chosen", document.chosen),
        *((f"$.trace[{k}].chosen", s.chosen) for k, s in enumerate(document.trace)),
    ]:
        if indices and any(one >= other for one, other in pairwise(indices)):
            raise InvalidResult(f"{source}: {place}: expected candidates that rise strictly, got another order")
    has_plan = document.chosen is not None and bool(document.value)
    if document.status in (Status.OPTIMAL, Status.FEASIBLE) and not has_plan:
        raise InvalidResult(
            f"{source}: $.chosen: expected a plan and its value, as the status is {document.status}, got none"
        )
    if document.chosen is not None and (document.coverage is None or document.shortfall is None):
        raise InvalidResult(f"{source}: $.coverage: expected coverage and shortfall of the plan, got none")


def _indices(given: Iterable[int] | None) -> NDArray[np.int32] | None:
    return None if given is None else _frozen(np.array(list(given), dtype=np.int32))


def _floats(given: Iterable[float] | None) -> NDArray[np.float64] | None:
    return None if given is None else _frozen(np.array(list(given), dtype=np.float64))


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array


def _bound(given: Bound) -> float:
    return -math.inf if given is None else float(given)


def _progress(step: ProgressV1) -> Progress:
    return Progress(
        seconds=step.seconds,
        objective=math.inf if step.objective is None else step.objective,
        bound=_bound(step.bound),
        chosen=_indices(step.chosen),
    )


def _diagnosis(given: DiagnosisV1) -> Diagnosis:
    return Diagnosis(
        unreachable=tuple(
            Unreachable(**{**msgspec.structs.asdict(u), "cliques": tuple(u.cliques)}) for u in given.unreachable
        ),
        unmet=tuple(Unmet(**{**msgspec.structs.asdict(u), "cliques": tuple(u.cliques)}) for u in given.unmet),
    )


def _certificate(given: CertificateV1, source: str | Path) -> Certificate:
    return Certificate(units=given.units, scale=given.scale, proof=_proof(given.proof, source, 0))


def _proof(given: ProofV1, source: str | Path, depth: int) -> Proof:
    if isinstance(given, PricesV1):
        return Prices(entry=_whole(given.entry), unit=_whole(given.unit))
    if isinstance(given, SweepV1):
        return Sweep(entry=_whole(given.entry), order=_whole(given.order), limit=given.limit)
    if depth >= MOST_DEPTH:
        raise InvalidResult(
            f"{source}: $.certificate: expected at most {MOST_DEPTH} splits and parts within each other, got more"
        )
    if isinstance(given, SplitV1):
        few, many = (_proof(side, source, depth + 1) for side in (given.few, given.many))
        return Split(element=given.element, count=given.count, few=few, many=many)
    return Parts(parts=tuple(_part(part, source, depth + 1) for part in given.parts))


def _part(given: PartV1, source: str | Path, depth: int) -> Part:
    return Part(
        elements=_whole(given.elements),
        charged=_whole(given.charged),
        charge=_whole(given.charge),
        proof=_proof(given.proof, source, depth),
    )


def _whole(given: list[int]) -> NDArray[np.int64]:
    return _frozen(np.array(given, dtype=np.int64))


def _certified(certificate: Certificate) -> dict[str, Any]:
    if not isinstance(certificate, Certificate):
        raise InvalidResult(f"certificate: expected a Certificate, got {type(certificate).__name__}")
    return {"units": certificate.units, "scale": certificate.scale, "proof": _proven(certificate.proof)}


def _proven(proof: Proof) -> dict[str, Any]:
    if isinstance(proof, Prices):
        return {"type": "prices", "entry": _plain(proof.entry), "unit": _plain(proof.unit)}
    if isinstance(proof, Sweep):
        return {"type": "sweep", "entry": _plain(proof.entry), "order": _plain(proof.order), "limit": proof.limit}
    if isinstance(proof, Split):
        sides = {"few": _proven(proof.few), "many": _proven(proof.many)}
        return {"type": "split", "element": proof.element, "count": proof.count, **sides}
    if isinstance(proof, Parts) and isinstance(proof.parts, tuple):
        return {"type": "parts", "parts": [_divided(part) for part in proof.parts]}
    raise InvalidResult(f"certificate: proof: expected Prices, a Sweep, a Split or Parts, got {type(proof).__name__}")


def _divided(part: Part) -> dict[str, Any]:
    if not isinstance(part, Part):
        raise InvalidResult(f"certificate: parts: expected a Part, got {type(part).__name__}")
    numbers = {name: _plain(getattr(part, name)) for name in ("elements", "charged", "charge")}
    return {**numbers, "proof": _proven(part.proof)}


def _plain(array: Any) -> list[Any]:
    if not isinstance(array, np.ndarray) or array.ndim != 1:
        raise InvalidResult(f"certificate: expected NumPy arrays of numbers, got {type(array).__name__}")
    return list(array.tolist())


def _step(k: int, step: Progress) -> dict[str, Any]:
    return {
        "seconds": float(step.seconds),
        "objective": _or_null(f"trace[{k}].objective", step.objective, math.inf),
        "bound": _bound_or_null(f"trace[{k}].bound", step.bound),
        "chosen": _listed(step.chosen),
    }


def _listed(array: NDArray[Any] | None) -> list[Any] | None:
    return None if array is None else array.tolist()


def _or_null(place: str, value: float, absent: float) -> float | None:
    """The number, or None where it is the infinity that stands for absence."""
    if value == absent:
        return None
    if not math.isfinite(value):
        raise InvalidResult(f"{place}: expected a number or {absent}, got {value}")
    return float(value)


def _bound_or_null(place: str, value: float) -> Bound:
    return "inf" if value == math.inf else _or_null(place, value, -math.inf)

"""`pscover solve`: find a plan, check it, and say how good it is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pscover.cli.fail import Exit, say
from pscover.cli.options import (
    FILE,
    backend_option,
    formulation_option,
    json_option,
    parameter_option,
    quiet_option,
    settings_options,
)

if TYPE_CHECKING:
    from pscover.instance import Instance
    from pscover.result import Result
    from pscover.verify import Verification


@click.command("solve", short_help="Find the cheapest plan of an instance and check it.")
@click.argument("instance", type=FILE)
@backend_option
@formulation_option
@parameter_option("--set", "parameters", "formulation")
@parameter_option("--backend-set", "tuning", "backend")
@settings_options(seconds=10.0)
@click.option("--start", type=FILE, metavar="RESULT", help="Start from the plan in a result file.")
@click.option("--output", "-o", type=FILE, metavar="FILE", help="Write the result to a .json file.")
@click.option("--trace", type=FILE, metavar="FILE", help="Write every improvement to a .jsonl file, one a line.")
@json_option
@quiet_option
def command(
    instance: Path,
    backend: str,
    formulation: str,
    parameters: tuple[tuple[str, str], ...],
    tuning: tuple[tuple[str, str], ...],
    start: Path | None,
    output: Path | None,
    trace: Path | None,
    as_json: bool,
    quiet: bool,
    **numbers: Any,
) -> Exit:
    """Find the cheapest plan of INSTANCE (.json, .npz, .scp, .rail, .sts, .txt), check it, and say how good it is.

    The result is recomputed from the instance in exact arithmetic, without a solver, before it is called verified.
    Ctrl-C ends the search and prints the best plan so far.

    \b
    Examples:
      pscover solve table.json
      pscover solve table.json --time 60 --gap 0.01 -o result.json
      pscover solve table.json -b greedy --json
      pscover solve table.json -f budgeted --set budget=3
    """
    from pscover import isolate, registry
    from pscover.cli.live import watching
    from pscover.cli.output import require_distinct, require_writable, wrote
    from pscover.io import load_instance, load_result, save_result
    from pscover.result import Settings
    from pscover.solve import solve
    from pscover.verify import verify

    settings = Settings(**numbers)
    engine = registry.backend(backend, dict(tuning))
    form = registry.formulation(formulation, dict(parameters))
    inputs = [path for path in (instance, start) if path is not None]
    require_distinct(output, trace)
    require_writable(output, inputs, suffixes=(".json",))
    require_writable(trace, inputs, suffixes=(".jsonl",))
    # The engine's process starts while the file is read.
    isolate.warm_up(engine)
    problem = load_instance(instance)
    first = None if start is None else _start(load_result(start), problem, start)
    with watching(f"{engine.name} x {form.name}", quiet=quiet) as line:
        result = solve(problem, backend=engine, formulation=form, settings=settings, start=first, observe=line)
    verification = verify(problem, result)
    try:
        if output is not None:
            save_result(result, output)
        if trace is not None:
            _save_trace(result, trace)
    finally:
        # A full disk must not cost the plan.
        _print(problem, result, verification, as_json=as_json)
    if not quiet:
        for path, what in ((output, "the result"), (trace, "the trace")):
            if path is not None:
                wrote(path, what)
        _hint(result, form.name)
    return code(result, verification)


def code(result: Result, verification: Verification) -> Exit:
    """The exit code of a result and its check."""
    from pscover.result import Stop

    if result.has_plan and verification.passed:
        return Exit.VERIFIED
    return Exit.INTERRUPTED if result.stop is Stop.INTERRUPT and verification.passed else Exit.NO_PLAN


def _hint(result: Result, formulation: str) -> None:
    """What to try next, where that is not plain."""
    from pscover.result import Status, Stop

    if result.status is Status.INFEASIBLE and formulation != "elastic":
        say("hint: --formulation elastic finds the plan that comes closest")
    elif result.stop is Stop.TIME and result.status is Status.UNKNOWN:
        say("hint: `--backend greedy -o first.json` is fast; `--start first.json` continues from its plan")
    elif result.stop is Stop.TIME:
        say(f"hint: --time {2 * result.settings.time:g} searches longer; --start continues from a result file")


def _start(given: Result, instance: Instance, path: Path) -> tuple[int, ...]:
    from pscover.errors import InvalidResult

    if given.chosen is None:
        raise InvalidResult(f"{path}: expected a result with a plan to start from, got one without ({given.status})")
    if given.digest != instance.digest:
        say(f"note: the plan in {path} is of another instance; it is used as far as it goes")
    return tuple(int(i) for i in given.chosen if i < instance.candidates)


def _save_trace(result: Result, path: Path) -> None:
    from pscover.cli.documents import progress_document
    from pscover.cli.output import plain
    from pscover.files import write_bytes

    lines = [json.dumps(plain(progress_document(step)), allow_nan=False) for step in result.trace]
    write_bytes(path, "".join(f"{line}\n" for line in lines).encode())


def _print(instance: Instance, result: Result, verification: Verification, *, as_json: bool) -> None:
    from pscover.cli.output import show, show_document

    if as_json:
        from pscover.cli.documents import instance_document, result_document, verification_document

        show_document(
            {
                "instance": instance_document(instance),
                "result": result_document(result),
                "verification": verification_document(verification),
            }
        )
        return
    from pscover.cli.tables import diagnosed, headline, outcome

    show(headline(instance), outcome(instance, result, verification))
    if result.diagnosis is not None:
        show("", diagnosed(instance, result.diagnosis))

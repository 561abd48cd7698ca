"""`pscover verify`: recompute in exact arithmetic what a result says of an instance."""

from __future__ import annotations

from pathlib import Path

import click

from pscover.cli.fail import Exit
from pscover.cli.options import FILE, json_option


@click.command("verify", short_help="Check a result against its instance, without a solver.")
@click.argument("instance", type=FILE)
@click.argument("result", type=FILE)
@json_option
def command(instance: Path, result: Path, as_json: bool) -> Exit:
    """Recompute what RESULT says of INSTANCE, in exact rational arithmetic and without a solver.

    Checked are the plan's indices and conflicts, every element's coverage, the requirements, the objective and the
    status. A bound is checked as far as the result holds a certificate of it; beyond that it is reported as unchecked.

    Exit code 0 if no check failed, 1 if one did.

    \b
    Example:
      pscover verify table.json result.json
    """
    from pscover.cli.output import show, show_document
    from pscover.io import load_instance, load_result
    from pscover.verify import verify

    problem, said = load_instance(instance), load_result(result)
    verification = verify(problem, said)
    if as_json:
        from pscover.cli.documents import instance_document, verification_document

        show_document({"instance": instance_document(problem), "verification": verification_document(verification)})
    else:
        from pscover.cli.tables import checks, headline

        verdict = "no check failed" if verification.passed else "VERIFICATION FAILED"
        show(headline(problem), checks(verification), f"{said.status}, {said.formulation} with {said.backend}: {verdict}")
    return Exit.VERIFIED if verification.passed else Exit.NO_PLAN

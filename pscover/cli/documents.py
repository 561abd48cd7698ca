"""Results, checks and instances as parts of the JSON document that a command prints with --json."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pscover.instance import Instance
    from pscover.result import Progress, Result
    from pscover.verify import Verification


def result_document(result: Result) -> dict[str, Any]:
    """The result as its file has it (schema "pscover.result/1"), with objective and gap, which follow from the rest."""
    from pscover.io.result import encode

    document: dict[str, Any] = json.loads(encode(result))
    return {**document, "objective": result.objective, "gap": result.gap}


def verification_document(verification: Verification) -> dict[str, Any]:
    """All checks, and whether none failed."""
    checks = [{"what": c.what, "verdict": c.verdict, "detail": c.detail} for c in verification.checks]
    certified = None if verification.certified is None else float(verification.certified)
    return {"passed": verification.passed, "checks": checks, "certified": certified}


def instance_document(instance: Instance) -> dict[str, Any]:
    """What identifies an instance."""
    return {
        "name": instance.meta.name,
        "source": instance.meta.source,
        "digest": instance.digest,
        "elements": instance.elements,
        "candidates": instance.candidates,
    }


def progress_document(progress: Progress) -> dict[str, Any]:
    """One line of a trace."""
    return {
        "seconds": progress.seconds,
        "objective": progress.objective,
        "bound": progress.bound,
        "chosen": progress.chosen,
    }

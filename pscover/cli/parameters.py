"""What a registered class says of itself: its first line and its parameters."""

from __future__ import annotations

import dataclasses
import inspect
import sys
from typing import Any


def summary(found: Any) -> str:
    """The first line of its module's docstring."""
    text = inspect.getdoc(sys.modules[found.__module__]) or inspect.getdoc(found) or ""
    return " ".join(text.partition("\n\n")[0].split()).rstrip(".")


def parameters(found: Any) -> list[dict[str, Any]]:
    """Name, type and default of each of its fields, in order."""
    return [{"name": field.name, "type": str(field.type), "default": _default(field)} for field in dataclasses.fields(found)]


def written(found: Any) -> str:
    """The parameters as one writes them, with their defaults."""
    return ", ".join(f"{row['name']}={row['default']}" for row in parameters(found))


def _default(field: dataclasses.Field[Any]) -> Any:
    if field.default is not dataclasses.MISSING:
        return field.default
    return field.default_factory() if field.default_factory is not dataclasses.MISSING else None

"""Numbers and lists as short words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

NOTHING = "-"


def number(value: float) -> str:
    """Up to six digits, no needless zeros; what is not finite is a dash.

    Examples
    --------
    >>> number(429.0), number(0.70312345), number(math.inf)
    ('429', '0.703123', '-')
    """
    if not math.isfinite(value):
        return NOTHING
    if value == int(value) and abs(value) < 1e15:
        return str(int(value))
    return f"{value:.6g}"


def percent(share: float) -> str:
    """A share in percent; a dash if it is not finite.

    Examples
    --------
    >>> percent(0.0), percent(0.01234), percent(math.inf)
    ('0 %', '1.23 %', '-')
    """
    if not math.isfinite(share):
        return NOTHING
    return "0 %" if share == 0 else f"{100 * share:.3g} %"


def seconds(value: float) -> str:
    """A time in seconds, to the hundredth.

    Examples
    --------
    >>> seconds(0.2149)
    '0.21 s'
    """
    return f"{value:.2f} s"


def count(amount: int, thing: str, things: str = "") -> str:
    """An amount of things.

    Examples
    --------
    >>> count(1, "grasp"), count(2, "clique")
    ('1 grasp', '2 cliques')
    """
    return f"{amount} {thing if amount == 1 else things or thing + 's'}"


def listed(items: Sequence[str], most: int) -> str:
    """The first of the items, and how many more there are.

    Examples
    --------
    >>> listed(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    if not items:
        return NOTHING
    rest = len(items) - most
    return ", ".join(items) if rest <= 0 else f"{', '.join(items[:most])} and {rest} more"


def spread(values: Any) -> str:
    """The range of an array of numbers.

    Examples
    --------
    >>> import numpy as np
    >>> spread(np.array([0.9, 0.5])), spread(np.ones(2)), spread(np.zeros(0))
    ('0.5 to 0.9', '1', '-')
    """
    if len(values) == 0:
        return NOTHING
    low, high = number(float(values.min())), number(float(values.max()))
    return low if low == high else f"{low} to {high}"

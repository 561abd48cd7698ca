"""What an experiment may know and a policy may not: where each garment is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """Where each garment is now, for counting only; every garment is in exactly one of the four tuples.

    Parameters
    ----------
    on_table, held, in_basket, off_table
        Indices of garments, ascending. Held: between the fingers. Off the table: more than half of it lay beyond an edge
        when all had come to rest, and a person took it away.
    names
        Of all garments, by index.
    labels
        What the camera sees, shape (H, W): 0 is the surface, 1 + j is garment j. Read-only.
    """

    on_table: tuple[int, ...]
    held: tuple[int, ...]
    in_basket: tuple[int, ...]
    off_table: tuple[int, ...]
    names: tuple[str, ...]
    labels: NDArray[np.int32]

    @property
    def visible(self) -> tuple[int, ...]:
        """Garments of which the camera sees at least one pixel, ascending."""
        seen = np.unique(self.labels)
        return tuple(int(label) - 1 for label in seen if label)

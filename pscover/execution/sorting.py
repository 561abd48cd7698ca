"""Classes of garments, for laundry that goes to several baskets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings
from pscover.seen import Seen

CLASSES = ("white", "dark", "coloured")


@dataclass(frozen=True, slots=True, kw_only=True)
class ByColour:
    """White, dark and coloured laundry, by the median colour of each garment.

    Parameters
    ----------
    white
        Lightest of the three channels from which a garment without colour is "white" (0 to 255).
    vivid
        Difference of the largest and the smallest channel from which a garment is "coloured".

    Raises
    ------
    InvalidSettings
        If a number is not from 0 to 255.
    """

    white: float = 140.0
    vivid: float = 60.0

    def __post_init__(self) -> None:
        for name, value in (("white", self.white), ("vivid", self.vivid)):
            if not 0 <= value <= 255:
                raise InvalidSettings(f"{name}: expected a number from 0 to 255, got {value!r}")

    def classes(self, photo: NDArray[np.uint8], seen: Seen) -> tuple[str, ...]:
        """The class of each garment of a photo, RGB of shape (H, W, 3).

        Examples
        --------
        >>> from pscover.scene import Scene
        >>> photo = np.array([[[255, 250, 245], [20, 20, 30], [200, 30, 30]]], dtype=np.uint8)
        >>> ByColour().classes(photo, Seen.whole(Scene.of([[1, 2, 3]])))
        ('white', 'dark', 'coloured')
        """
        labels = seen.labels
        return tuple(self._class(np.median(photo[labels == value], axis=0)) for value in seen.scene.values)

    def _class(self, colour: NDArray[np.float64]) -> str:
        if colour.max() - colour.min() >= self.vivid:
            return "coloured"
        return "white" if colour.max() >= self.white else "dark"

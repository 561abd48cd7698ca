"""The overhead camera of a world: `pscover.robot.Camera`, with the noise of a real one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

from pscover.robot import Frame

if TYPE_CHECKING:
    from pscover.sim.world import World

STEP = 0.02
"""Metres between neighbouring pixels at which a depth camera loses sight in the shadow of its projector."""
LOST = 0.35
"""Part of the pixels at such edges whose depth is unknown."""


@dataclass(frozen=True, slots=True, eq=False)
class ClothCamera:
    """Looks at a world from above, with the arm out of the way."""

    world: World
    generator: np.random.Generator

    def capture(self) -> Frame:
        """What is seen now; depth is NaN where it is unknown."""
        world, sensor = self.world, self.world.settings.sensor
        world.clock.capture()
        picture = world.painter.picture(world.cloth, world.view)
        # A lens spreads light a little, and bright pixels are noisier.
        blurred = gaussian_filter(picture.light, (0.45, 0.45, 0), mode="nearest")
        value = 255.0 * np.clip(blurred, 0.0, 1.0) ** (1 / 2.2)
        noise = self.generator.standard_normal(value.shape, dtype=np.float32)
        noisy = value + sensor.colour_noise * (0.6 + 0.4 * value / 255.0) * noise
        return Frame(rgb=np.clip(noisy + 0.5, 0, 255).astype(np.uint8), depth=self._depth(picture.depth))

    def _depth(self, true: NDArray[np.float64]) -> NDArray[np.float32]:
        sensor = self.world.settings.sensor
        seen = np.where(np.isfinite(true), true, sensor.height)
        depth = (seen + sensor.depth_noise * self.generator.standard_normal(seen.shape)).astype(np.float32)
        edge = maximum_filter(seen, 3) - minimum_filter(seen, 3) > STEP
        lost = self.generator.random(seen.shape) < np.where(edge, LOST, sensor.holes)
        depth[lost] = np.nan
        return depth

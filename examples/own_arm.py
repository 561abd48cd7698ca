"""An arm of your own: write two small classes, and every policy drives it.

`MyArm` and `MyCamera` stand for the driver of a real arm and camera. What is between the lines of dashes is a stand-in,
so that the example runs anywhere: a table whose garments are labels in an image.

    python examples/own_arm.py [POLICY]
"""

from __future__ import annotations

import sys

import numpy as np

from pscover import PscoverError, registry
from pscover.execution.declutter import Patience, declutter
from pscover.execution.events import Decided, Ended, MotionFailed, Moved, PolicyFailed
from pscover.execution.sight import PhotoEyes
from pscover.inputs import Look
from pscover.robot import Frame, Pose, RobotFailed

PIXELS_PER_CM = 4.7
WORKSPACE_CM = (42.0, 30.0)
# ---------------------------------------------------------------------------------------------------------------------------
TABLE = np.zeros((141, 200), dtype=int)
TABLE[20:70, 15:70], TABLE[55:110, 50:95], TABLE[30:100, 130:180] = 1, 2, 3
COLOURS = np.array([[205, 205, 200], [170, 40, 40], [40, 70, 160], [40, 120, 60]], dtype=np.uint8)
# ---------------------------------------------------------------------------------------------------------------------------


class MyCamera:
    """Looks from above. Every frame has the same shape."""

    def capture(self) -> Frame:
        """What is seen now: ask your driver for RGB, and for depth in metres if there is any."""
        return Frame(rgb=COLOURS[TABLE])


class MyArm:
    """An arm with a parallel jaw, which thinks in centimetres from the corner of the table."""

    def __init__(self) -> None:
        self.held: list[int] = []

    def pick(self, pose: Pose) -> None:
        """Open, go down, close, lift. Your calibration turns pixels into the arm's own coordinates."""
        x, y = pose.x / PIXELS_PER_CM, pose.y / PIXELS_PER_CM
        if not (0 <= x <= WORKSPACE_CM[0] and 0 <= y <= WORKSPACE_CM[1]):
            # Say so, and the run goes on elsewhere. Any other exception ends it.
            raise RobotFailed(f"({x:.1f}, {y:.1f}) cm is out of reach")
        # -------------------------------------------------------------------------------------------------------------------
        row, column = round(pose.y), round(pose.x)
        under = np.unique(TABLE[max(0, row - 6) : row + 7, max(0, column - 6) : column + 7])
        self.held = [int(label) for label in under if label]
        TABLE[np.isin(TABLE, self.held)] = 0
        # -------------------------------------------------------------------------------------------------------------------

    def place(self, point: tuple[float, float]) -> None:
        """Put down what is held and let go; only `consolidation` asks for it."""
        # -------------------------------------------------------------------------------------------------------------------
        row, column = min(max(round(point[1]), 20), 120), min(max(round(point[0]), 20), 179)
        for label in self.held:
            TABLE[row - 20 : row + 20, column - 20 : column + 20] = label
        self.held = []
        # -------------------------------------------------------------------------------------------------------------------

    def transport(self) -> None:
        """Take what is held to the basket and let go."""
        self.held = []

    def weight(self) -> float | None:
        """Kilograms held, or None if your arm has no scale."""
        return None


def main(policy: str = "segment") -> int:
    """Clear the table, and print what happens."""
    eyes = PhotoEyes(look=Look(pixels_per_cm=PIXELS_PER_CM, basket=(230.0, 70.0)))
    # A motion that takes more than a minute ends the run.
    patience = Patience(watchdog=60.0, most_transports=20)
    trips = 0
    for event in declutter(MyArm(), MyCamera(), registry.policy(policy), eyes=eyes, patience=patience):
        match event:
            case Decided(plan=plan) if plan is not None:
                print(f"a plan of {len(plan.grasps)} grasps for {plan.scene.garments} garments")
            case Moved(action=action):
                trips += type(action).__name__ == "Transport"
                print(f"  {action}")
            case MotionFailed(message=message) | PolicyFailed(message=message):
                print(f"  failed: {message}")
            case Ended(reason=reason):
                print(f"{reason} after {trips} trips")
    return 0 if not TABLE.any() else 1


if __name__ == "__main__":
    try:
        sys.exit(main(*sys.argv[1:2]))
    except PscoverError as problem:
        # A policy that does not exist, or one that needs the depth that `MyCamera` does not give.
        sys.exit(f"own_arm: {problem}")

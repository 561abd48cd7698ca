"""A world of cloth: a robot and a camera that need no hardware. Policies never import it, and it knows no predictor.

`World.scene(seed)` pours garments over the table and mixes them with random pick-and-place moves, as between two runs of
the paper's experiment (section 7). What a policy gets is `world.camera` and `world.robot`, which implement
`pscover.robot.Camera` and `pscover.robot.Robot`; what an experiment counts is `world.truth()`.

    from pscover.sim import World, WorldSettings

    world = World.scene(seed=3, cache=Path("scenes"))  # cache: an existing folder, or None
    frame = world.camera.capture()                     # rgb (282, 470, 3) uint8, depth (282, 470) float32, NaN = unknown
    world.robot.pick(Pose(x=200, y=100, theta=0.3))    # pixels of the image
    world.robot.transport()                            # or .place((x, y)); an empty hand may transport too
    world.robot.weight()                               # kilograms that pull at the fingers
    truth = world.truth()                              # on_table, held, in_basket, off_table: tuples of garment indices
    truth.labels                                       # (282, 470) int32 as seen: 0 surface, 1 + index of the garment
    truth.names                                        # of all garments, by index
    world.layers()                                     # hidden garments too: (layer, row, column), lowest layer first
    world.seconds                                      # the robot's clock, by `WorldSettings.pace`
    world.basket, world.pixels_per_cm                  # for `Scene.of(..., basket=, pixels_per_cm=)`
    with world.film(frames.append, fps=10, view=Oblique()):  # or Overhead(); called with a pscover.robot.Frame
        world.robot.transport()

Lengths are metres in a frame that looks like the image: x right, y down, z up from the table, the origin in the table's
corner at the top left. One world runs in one thread; worlds share nothing. The same seed and settings give the same world
on the same machine.

The cloth (`step`): particles about 2 cm apart, joined by nearly inextensible edges and soft hinges that keep part of a
bend (wrinkles), in contact with each other, with the table and with two fingers under Coulomb friction; extended
position-based dynamics with small steps (Macklin, Müller, Chentanez 2016; Macklin et al. 2019). A grasp is a motion of
the fingers: they push cloth aside, drag it together, and stop where it resists as hard as the jaw can press. What then
bridges the gap between the pads is held, each particle up to its share of the grip's friction; beyond that it slips
(`grip`).
"""

from pscover.sim.settings import Gripper, Material, Pace, Pour, Sensor, WorldSettings
from pscover.sim.truth import Truth
from pscover.sim.view import Oblique, Overhead
from pscover.sim.world import World

__all__ = [
    "Gripper",
    "Material",
    "Oblique",
    "Overhead",
    "Pace",
    "Pour",
    "Sensor",
    "Truth",
    "World",
    "WorldSettings",
]

"""From what is seen in each pixel to light: fabric, creases, lamp and sky."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pscover.engine.jit import inner, kernel
from pscover.sim.cloth import FloatArray, IntArray
from pscover.sim.fabric import GRAIN
from pscover.sim.light import CELL, Light

LAMP_LIGHT, SKY_LIGHT = 0.60, 0.44
"""Of the lamp and of the sky, on a white sheet that lies flat."""
BURIED = 0.02
"""Metres below the uppermost cloth at which the lamp does not reach a surface."""


class Bodies(NamedTuple):
    """Everything that can be drawn.

    Parameters
    ----------
    corners, normals
        Shape (corners, 3).
    place
        Of each corner on its texture, metres, shape (corners, 2).
    triangles
        Shape (triangles, 3).
    front, back
        The texture on each side of a triangle, shape (triangles,).
    """

    corners: FloatArray
    normals: FloatArray
    place: FloatArray
    triangles: IntArray
    front: IntArray
    back: IntArray


class Paint(NamedTuple):
    """The arrays of a `pscover.sim.fabric.Atlas`."""

    colour: NDArray[np.float32]
    slope: NDArray[np.float32]
    place: IntArray
    origin: FloatArray


@kernel
def shade(
    which: IntArray,
    inside: FloatArray,
    bodies: Bodies,
    paint: Paint,
    light: Light,
    eye: FloatArray,
    out: NDArray[np.float32],
    room: FloatArray,
) -> None:
    """The light from each pixel, linear.

    Parameters
    ----------
    which, inside
        What is seen in each sample, see `pscover.sim.raster.draw`; an image finer than `out` by a whole factor.
    bodies, paint, light, eye
        The world, and where the camera is.
    out
        Mean over samples, shape (H, W, 3); samples that show nothing count as they are.
    room
        For the point of a sample, its normal, its place on the texture and its colour, shape (4, 3).
    """
    rows, columns = out.shape[0], out.shape[1]
    factor = which.shape[0] // rows
    at, normal, texel, colour = room[0], room[1], room[2], room[3]
    for row in range(rows):
        for column in range(columns):
            top, left = row * factor, column * factor
            first = which[top, left]
            # A flat body (one whose two sides are alike) needs one sample where it fills the pixel.
            whole = first >= 0 and bodies.front[first] == bodies.back[first]
            for y in range(top, top + factor):
                for x in range(left, left + factor):
                    whole = whole and which[y, x] == first
            side = 1 if whole else factor
            nothing, total_r, total_g, total_b = 0, 0.0, 0.0, 0.0
            for y in range(top, top + side):
                for x in range(left, left + side):
                    t = which[y, x]
                    if t < 0:
                        nothing += 1
                        continue
                    _sample(bodies, paint, light, eye, t, inside[y, x, 0], inside[y, x, 1], at, normal, texel, colour)
                    total_r += colour[0]
                    total_g += colour[1]
                    total_b += colour[2]
            share = 1.0 / (side * side)
            out[row, column, 0] = share * (total_r + nothing * out[row, column, 0])
            out[row, column, 1] = share * (total_g + nothing * out[row, column, 1])
            out[row, column, 2] = share * (total_b + nothing * out[row, column, 2])


@inner
def _sample(
    bodies: Bodies,
    paint: Paint,
    light: Light,
    eye: FloatArray,
    t: int,
    wb: float,
    wc: float,
    at: FloatArray,
    normal: FloatArray,
    texel: FloatArray,
    colour: FloatArray,
) -> None:
    """The light from one place on a triangle."""
    _blend(bodies, t, wb, wc, at, normal, texel)
    facing = 0.0
    for k in range(3):
        facing += normal[k] * (eye[k] - at[k])
    side = bodies.front[t] if facing >= 0 else bodies.back[t]
    if facing < 0:
        for k in range(3):
            normal[k] = -normal[k]
    texture = _texel(paint, side, texel)
    _crease(bodies, t, paint.slope[texture, 0], paint.slope[texture, 1], normal)
    bright = _bright(light, at, normal)
    for k in range(3):
        colour[k] = bright * paint.colour[texture, k]


@inner
def _blend(bodies: Bodies, t: int, wb: float, wc: float, at: FloatArray, normal: FloatArray, texel: FloatArray) -> None:
    a, b, c = bodies.triangles[t, 0], bodies.triangles[t, 1], bodies.triangles[t, 2]
    wa = 1.0 - wb - wc
    for k in range(3):
        at[k] = wa * bodies.corners[a, k] + wb * bodies.corners[b, k] + wc * bodies.corners[c, k]
        normal[k] = wa * bodies.normals[a, k] + wb * bodies.normals[b, k] + wc * bodies.normals[c, k]
    for k in range(2):
        texel[k] = wa * bodies.place[a, k] + wb * bodies.place[b, k] + wc * bodies.place[c, k]


@inner
def _texel(paint: Paint, texture: int, place: FloatArray) -> int:
    rows, columns = paint.place[texture, 1], paint.place[texture, 2]
    x = int((place[0] - paint.origin[texture, 0]) / GRAIN + 0.5)
    y = int((place[1] - paint.origin[texture, 1]) / GRAIN + 0.5)
    return int(paint.place[texture, 0] + min(max(y, 0), rows - 1) * columns + min(max(x, 0), columns - 1))


@inner
def _crease(bodies: Bodies, t: int, slope_x: float, slope_y: float, normal: FloatArray) -> None:
    """Tilt the normal by the slope of the relief, which is given along the texture's axes."""
    if slope_x != 0.0 or slope_y != 0.0:
        a, b, c = bodies.triangles[t, 0], bodies.triangles[t, 1], bodies.triangles[t, 2]
        bu, bv = bodies.place[b, 0] - bodies.place[a, 0], bodies.place[b, 1] - bodies.place[a, 1]
        cu, cv = bodies.place[c, 0] - bodies.place[a, 0], bodies.place[c, 1] - bodies.place[a, 1]
        area = bu * cv - cu * bv
        if abs(area) > 1e-14:
            for k in range(3):
                eb = bodies.corners[b, k] - bodies.corners[a, k]
                ec = bodies.corners[c, k] - bodies.corners[a, k]
                normal[k] -= slope_x * (cv * eb - bv * ec) / area + slope_y * (bu * ec - cu * eb) / area


@inner
def _bright(light: Light, at: FloatArray, normal: FloatArray) -> float:
    rows, columns = light.height.shape
    length = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2) + 1e-12
    towards = (normal[0] * light.towards[0] + normal[1] * light.towards[1] + normal[2] * light.towards[2]) / length
    x, y = int(at[0] / CELL), int(at[1] / CELL)
    sky, lamp = 1.0, 1.0
    if 0 <= x < columns and 0 <= y < rows:
        sky, lamp = light.sky[y, x], light.lamp[y, x]
        below = min(1.0, max(0.0, (light.height[y, x] - at[2]) / BURIED - 0.15))
        sky, lamp = sky * (1.0 - 0.6 * below), lamp * (1.0 - below)
    # Cloth is fuzzy: light creeps a little round the bend.
    direct = max(0.0, (towards + 0.15) / 1.15)
    bright: float = LAMP_LIGHT * direct * lamp / light.towards[2] + SKY_LIGHT * sky * (0.65 + 0.35 * normal[2] / length)
    return bright

"""Which triangle is seen in each pixel: a z-buffer."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pscover.engine.jit import kernel
from pscover.sim.cloth import FloatArray, IntArray


@kernel
def draw(
    screen: FloatArray, triangles: IntArray, shown: FloatArray, nearest: FloatArray, which: IntArray, inside: FloatArray
) -> None:
    """Draw triangles over what is drawn already.

    Parameters
    ----------
    screen
        Column, row and distance from the camera of each corner, shape (corners, 3); what is not before the camera has a
        distance that is not positive.
    triangles
        Corners, shape (triangles, 3).
    shown
        Shape (triangles,): 0.0 leaves a triangle out.
    nearest
        Distance of what is seen, shape (H, W).
    which
        Its triangle, shape (H, W), -1 where there is none.
    inside
        Weights of its second and third corner, shape (H, W, 2), right in perspective.
    """
    rows, columns = nearest.shape
    for t in range(len(triangles)):
        if shown[t] == 0.0:
            continue
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        az, bz, cz = screen[a, 2], screen[b, 2], screen[c, 2]
        if az <= 0.0 or bz <= 0.0 or cz <= 0.0:
            continue
        ax, ay, bx, by, cx, cy = screen[a, 0], screen[a, 1], screen[b, 0], screen[b, 1], screen[c, 0], screen[c, 1]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(area) < 1e-12:
            continue
        left = max(0, math.ceil(min(ax, min(bx, cx))))
        right = min(columns - 1, math.floor(max(ax, max(bx, cx))))
        top = max(0, math.ceil(min(ay, min(by, cy))))
        bottom = min(rows - 1, math.floor(max(ay, max(by, cy))))
        # Weights are linear along a row.
        step_b, step_c = (cy - ay) / area, -(by - ay) / area
        ia, ib, ic = 1.0 / az, 1.0 / bz, 1.0 / cz
        for row in range(top, bottom + 1):
            start_b = (-ax * (cy - ay) - (cx - ax) * (row - ay)) / area
            start_c = ((bx - ax) * (row - ay) + ax * (by - ay)) / area
            for column in range(left, right + 1):
                vb, vc = start_b + column * step_b, start_c + column * step_c
                va = 1.0 - vb - vc
                if va < 0.0 or vb < 0.0 or vc < 0.0:
                    continue
                distance = 1.0 / (va * ia + vb * ib + vc * ic)
                if distance < nearest[row, column]:
                    nearest[row, column] = distance
                    which[row, column] = t
                    inside[row, column, 0] = vb * distance * ib
                    inside[row, column, 1] = vc * distance * ic


@kernel
def pile(
    screen: FloatArray,
    triangles: IntArray,
    garment: IntArray,
    shown: FloatArray,
    depth: FloatArray,
    owner: NDArray[np.int8],
) -> None:
    """All that lies above each pixel.

    Parameters
    ----------
    screen, triangles, shown
        See `draw`.
    garment
        Of each triangle.
    depth, owner
        Distance and 1 + garment of each layer, the furthest first, 0 above the last; shape (layers, H, W), zeros at first.
    """
    most, rows, columns = depth.shape
    for t in range(len(triangles)):
        if shown[t] == 0.0:
            continue
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        az, bz, cz = screen[a, 2], screen[b, 2], screen[c, 2]
        ax, ay, bx, by, cx, cy = screen[a, 0], screen[a, 1], screen[b, 0], screen[b, 1], screen[c, 0], screen[c, 1]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(area) < 1e-12:
            continue
        left = max(0, math.ceil(min(ax, min(bx, cx))))
        right = min(columns - 1, math.floor(max(ax, max(bx, cx))))
        top = max(0, math.ceil(min(ay, min(by, cy))))
        bottom = min(rows - 1, math.floor(max(ay, max(by, cy))))
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                vb = ((column - ax) * (cy - ay) - (cx - ax) * (row - ay)) / area
                vc = ((bx - ax) * (row - ay) - (column - ax) * (by - ay)) / area
                if vb < 0.0 or vc < 0.0 or vb + vc > 1.0:
                    continue
                distance = (1.0 - vb - vc) * az + vb * bz + vc * cz
                k = most - 1
                if owner[k, row, column] != 0:
                    continue
                while k > 0 and (owner[k - 1, row, column] == 0 or depth[k - 1, row, column] < distance):
                    depth[k, row, column] = depth[k - 1, row, column]
                    owner[k, row, column] = owner[k - 1, row, column]
                    k -= 1
                depth[k, row, column] = distance
                owner[k, row, column] = garment[t] + 1


@kernel
def normals(corners: FloatArray, triangles: IntArray, out: FloatArray) -> None:
    """The normal of each corner, of unit length: the mean over its triangles by their area."""
    out[:] = 0.0
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ux, uy, uz = corners[b, 0] - corners[a, 0], corners[b, 1] - corners[a, 1], corners[b, 2] - corners[a, 2]
        vx, vy, vz = corners[c, 0] - corners[a, 0], corners[c, 1] - corners[a, 1], corners[c, 2] - corners[a, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for k in range(3):
            corner = triangles[t, k]
            out[corner, 0] += nx
            out[corner, 1] += ny
            out[corner, 2] += nz
    for i in range(len(out)):
        length = math.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2) + 1e-30
        for k in range(3):
            out[i, k] /= length

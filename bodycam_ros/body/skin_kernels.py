"""How far a point is from the smooth union of limbs: the signed distance field that a body's skin is meshed from.

A limb is the hull of ellipsoidal balls along a line, as in ``limb_mesh``.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

_FAR_M = 0.12  # beyond it a lower bound is enough: no surface passes there
_LEAST = 1e-12


@kernel("(f8, f8, f8, f8[:, ::1], f8[:, ::1], i8[::1], f8)")
def distance_to_limbs(x: float, y: float, z: float, frames: Array, balls: Array, first_ball: Whole, k: float) -> float:
    """Signed distance of a point to a union of limbs [m], exact to first order at the surface; negative inside.

    Two surfaces that meet at an angle are filleted. Where they are parallel, as where two limbs of one width continue
    each other, or opposite, as thighs are, nothing is added: widths stay as they are.

    Args:
        x, y, z: of the point.
        frames: (L, 16) of each limb its start, its axes (along, broad, deep), the centre of a ball around it, and that
            ball's radius [m].
        balls: (B, 4) where each ball is along its limb, and its half axes [m].
        first_ball: (L + 1,) first row in ``balls`` of each limb.
        k: reach of the fillets [m].
    """
    distance, nx, ny, nz = math.inf, 0.0, 0.0, 0.0
    for limb in range(len(frames)):
        frame = frames[limb]
        around = math.sqrt((x - frame[12]) ** 2 + (y - frame[13]) ** 2 + (z - frame[14]) ** 2) - frame[15]
        if around > _FAR_M:
            distance = min(distance, around)
            continue
        px, py, pz = x - frame[0], y - frame[1], z - frame[2]
        along = frame[3] * px + frame[4] * py + frame[5] * pz
        broad = frame[6] * px + frame[7] * py + frame[8] * pz
        deep = frame[9] * px + frame[10] * py + frame[11] * pz
        own, na, nb, nd = math.inf, 1.0, 0.0, 0.0
        for row in range(first_ball[limb], first_ball[limb + 1]):
            at, ra, rb, rd = balls[row]
            da, db, dd = (along - at) / ra, broad / rb, deep / rd
            ga, gb, gd = da / ra, db / rb, dd / rd
            k0, k1 = math.sqrt(da * da + db * db + dd * dd), math.sqrt(ga * ga + gb * gb + gd * gd)
            near = k0 * (k0 - 1.0) / k1 if k1 > _LEAST else -min(ra, rb, rd)
            if near < own:
                own, na, nb, nd = near, ga / max(k1, _LEAST), gb / max(k1, _LEAST), gd / max(k1, _LEAST)
        mx = na * frame[3] + nb * frame[6] + nd * frame[9]
        my = na * frame[4] + nb * frame[7] + nd * frame[10]
        mz = na * frame[5] + nb * frame[8] + nd * frame[11]
        cosine = nx * mx + ny * my + nz * mz
        reach = k * (1.0 - cosine * cosine)
        overlap = max(reach - abs(distance - own), 0.0) if math.isfinite(distance) else 0.0
        if own < distance:
            distance, nx, ny, nz = own, mx, my, mz
        if overlap > 0.0:
            distance -= overlap * overlap / (4.0 * reach)
    return distance

"""Patches of landmarks: warped from a reference picture and aligned with an image.

The alignment is inverse compositional (Baker and Matthews 2004): what is linearised is the warped patch, once. It
solves for the shift together with a gain and a bias of the light. A patch lies on the plane of its landmark's surface,
so that picture and image differ near it by an affine map: the quotient of the two projections' derivatives along the
plane.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.lens_kernels import in_image, project_point_with_jacobian
from bodycam_ros.kernels import kernel
from bodycam_ros.registration.landmark_choice_kernels import in_camera, project_moving

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Whole = NDArray[np.int64]
Single = NDArray[np.float32]  # half the width of a double: twice as many to a vector instruction

PATCH = 8  # [px] its side
_RING = PATCH + 2  # with the pixels around it that its slopes need
_MOST_STEPS = 8
_STILL = 0.02  # [px] the iteration ends below this step
_FARTHEST = 4.0  # [px] of its level: a larger shift is to another place
_LEAST_SLOPE = 300.0  # [grey levels squared] of a patch in its flattest direction: else it slides
_LEAST_GAIN, _MOST_GAIN = 0.1, 10.0
_BITS = 24  # of a pixel where its place is a whole number
_MOST_LEVELS = 4  # of a reference picture's pyramid, above its own size


@kernel(
    "(f8[::1], f8[:, ::1], f8[::1], f8, u1[::1], i8[:, ::1], f8[:, ::1], u2[::1], f8[:, :, ::1], u1[:, ::1],"
    " i8[:, :, ::1], i8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], i8, i8, f8)",
)
def align_patches(
    lens: Array,
    world_T_camera: Array,
    twist: Array,
    readout_time: float,
    image: Bytes,
    image_levels: Whole,
    reference_lenses: Array,
    camera_of_view: NDArray[np.uint16],
    world_T_reference: Array,
    references: Bytes,
    reference_levels: Whole,
    views: Whole,
    reference_pixels: Array,
    points_world: Array,
    normals: Array,
    first_level: int,
    last_level: int,
    least_likeness: float,
) -> tuple[Array, Array]:
    """Places of landmarks in an image, by patches of reference pictures.

    Args:
        lens: of the camera.
        world_T_camera: (4, 4) its pose, as predicted.
        twist, readout_time: (6,) its motion, and the read-out time of its rows [s].
        image, image_levels: (bytes,) its pyramid, and (levels, 3) of it.
        reference_lenses: (C, PROJECTION or more) of the cameras of the reference pictures.
        camera_of_view: (K,) the camera of each.
        world_T_reference: (K, 4, 4) their poses.
        references, reference_levels: (K, bytes) their pyramids, and (C, levels, 3) of those of each camera.
        views: (N,) the picture that each patch is taken from.
        reference_pixels: (N, 2) of the landmarks in their pictures; none (0, 2): their projections.
        points_world: (N, 3) landmarks [m].
        normals: (N, 3) of their surfaces.
        first_level, last_level: of the image's pyramid, from coarse to fine.
        least_likeness: correlation of patch and image in the end.

    Returns:
        Pixels (N, 2), and the correlations (N,): NaN where there is no patch, or it is not found.
    """
    count = len(points_world)
    pixels, likeness = np.empty((count, 2)), np.full(count, math.nan)
    patch, ring = np.empty((3, PATCH * PATCH), np.float32), np.empty((_RING, _RING), np.float32)
    for n in range(count):
        k = views[n]
        x, y, z, dx, dy, dz = in_camera(world_T_camera, points_world[n, 0], points_world[n, 1], points_world[n, 2])
        pixels[n, 0], pixels[n, 1], valid = project_moving(lens, x, y, z, twist, readout_time)
        if not valid or k < 0:
            continue
        ax, ay, az, bx, by, bz = _along_plane(normals[n, 0], normals[n, 1], normals[n, 2])
        seen, _, _, a00, a01, a10, a11 = _derivative(lens, world_T_camera, x, y, z, ax, ay, az, bx, by, bz)
        x, y, z, dx, dy, dz = in_camera(
            world_T_reference[k], points_world[n, 0], points_world[n, 1], points_world[n, 2]
        )
        camera = camera_of_view[k]
        known, u, v, b00, b01, b10, b11 = _derivative(
            reference_lenses[camera], world_T_reference[k], x, y, z, ax, ay, az, bx, by, bz
        )
        determinant = a00 * a11 - a01 * a10
        if not (seen and known and abs(determinant) > 1e-9):
            continue
        if len(reference_pixels):
            u, v = reference_pixels[n, 0], reference_pixels[n, 1]
        # reference pixels by image pixels
        w00, w01 = (b00 * a11 - b01 * a10) / determinant, (b01 * a00 - b00 * a01) / determinant
        w10, w11 = (b10 * a11 - b11 * a10) / determinant, (b11 * a00 - b10 * a01) / determinant
        scale = math.sqrt(abs(w00 * w11 - w01 * w10))
        if not (scale > 0.05 and scale < 40.0):
            continue
        for level in range(first_level, last_level - 1, -1):
            size = 2.0**level
            above = int(min(max(round(math.log2(scale * size)), 0), min(_MOST_LEVELS, reference_levels.shape[1] - 1)))
            share = size / 2.0**above
            if not _warp(
                references[k],
                reference_levels[camera, above],
                u / 2.0**above,
                v / 2.0**above,
                w00 * share,
                w01 * share,
                w10 * share,
                w11 * share,
                ring,
            ):
                likeness[n] = math.nan
                continue
            u_found, v_found, likeness[n] = _align(
                image, image_levels[level], pixels[n, 0] / size, pixels[n, 1] / size, ring, patch
            )
            if likeness[n] >= (least_likeness if level == last_level else 0.5 * least_likeness):
                pixels[n, 0], pixels[n, 1] = u_found * size, v_found * size
            elif level == last_level:
                likeness[n] = math.nan
        if not in_image(lens, pixels[n, 0], pixels[n, 1]):
            likeness[n] = math.nan
    return pixels, likeness


@kernel()
def _along_plane(nx: float, ny: float, nz: float) -> tuple[float, float, float, float, float, float]:
    """Two unit vectors along the plane of a unit normal."""
    if abs(nx) < 0.7:
        ax = 0.0
        ay = nz
        az = -ny
    else:
        ax = -nz
        ay = 0.0
        az = nx
    length = math.sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax / length, ay / length, az / length
    return ax, ay, az, ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax


@kernel()
def _derivative(
    lens: Array,
    world_T_camera: Array,
    x: float,
    y: float,
    z: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
) -> tuple[bool, float, float, float, float, float, float]:
    """Whether a point is in view, its pixel, and the pixel's derivatives along two directions of the world."""
    u, v, valid, u_x, u_y, u_z, v_x, v_y, v_z = project_point_with_jacobian(lens, x, y, z)
    T = world_T_camera
    ax, ay, az = (
        T[0, 0] * ax + T[1, 0] * ay + T[2, 0] * az,
        T[0, 1] * ax + T[1, 1] * ay + T[2, 1] * az,
        T[0, 2] * ax + T[1, 2] * ay + T[2, 2] * az,
    )
    bx, by, bz = (
        T[0, 0] * bx + T[1, 0] * by + T[2, 0] * bz,
        T[0, 1] * bx + T[1, 1] * by + T[2, 1] * bz,
        T[0, 2] * bx + T[1, 2] * by + T[2, 2] * bz,
    )
    return (
        valid,
        u,
        v,
        u_x * ax + u_y * ay + u_z * az,
        u_x * bx + u_y * by + u_z * bz,
        v_x * ax + v_y * ay + v_z * az,
        v_x * bx + v_y * by + v_z * bz,
    )


@kernel()
def _warp(
    picture: Bytes,
    level: Whole,
    u: float,
    v: float,
    w00: float,
    w01: float,
    w10: float,
    w11: float,
    ring: Single,
) -> bool:
    """Fill a patch and the pixels around it (_RING, _RING) from a picture; False where that ends.

    Places are whole numbers, which costs 0.6 of floating point; those of pixels are unsigned, since numba tests others
    for being negative.
    """
    start, height, width = level[0], level[1], level[2]
    reach = 0.5 * (_RING - 1)
    across, down = reach * (abs(w00) + abs(w01)), reach * (abs(w10) + abs(w11))
    if not (u - across >= 0.0 and v - down >= 0.0 and u + across < width - 1.001 and v + down < height - 1.001):
        return False
    left, top = int(u - across), int(v - down)
    pixels = picture[start + top * width + left :]
    single, scale = np.float32, 2.0**_BITS
    by_column_x, by_row_x = int(w00 * scale), int(w01 * scale)
    by_column_y, by_row_y = int(w10 * scale), int(w11 * scale)
    first_x = int((u - left - reach * (w00 + w01)) * scale)
    first_y = int((v - top - reach * (w10 + w11)) * scale)
    one = np.uint64(1)
    below = np.uint64(width)
    rest = 2**_BITS - 1
    share = single(1.0 / scale)
    for j in range(_RING):
        x, y = first_x + j * by_row_x, first_y + j * by_row_y
        for i in range(_RING):
            place = np.uint64((y >> _BITS) * width + (x >> _BITS))
            share_x, share_y = share * single(np.int32(x & rest)), share * single(np.int32(y & rest))
            p00, p01 = single(pixels[place]), single(pixels[place + one])
            p10, p11 = single(pixels[place + below]), single(pixels[place + below + one])
            upper, lower = p00 + share_x * (p01 - p00), p10 + share_x * (p11 - p10)
            ring[j, i] = upper + share_y * (lower - upper)
            x, y = x + by_column_x, y + by_column_y
    return True


@kernel()
def _align(image: Bytes, level: Whole, u: float, v: float, ring: Single, patch: Single) -> tuple[float, float, float]:
    """Place (u, v) of a patch (_RING, _RING) near a pixel of an image's level, and its correlation there.

    The image is a I = gain * (T + shift . slope T) + bias: its regression on the patch, its slopes and a constant.
    """
    start, height, width = level[0], level[1], level[2]
    count = PATCH * PATCH
    n = 0
    mean = 0.0
    mean_x = 0.0
    mean_y = 0.0
    for j in range(1, _RING - 1):
        for i in range(1, _RING - 1):
            patch[0, n] = ring[j, i]
            patch[1, n] = 0.5 * (ring[j, i + 1] - ring[j, i - 1])
            patch[2, n] = 0.5 * (ring[j + 1, i] - ring[j - 1, i])
            mean, mean_x, mean_y = mean + patch[0, n], mean_x + patch[1, n], mean_y + patch[2, n]
            n += 1
    mean, mean_x, mean_y = mean / count, mean_x / count, mean_y / count
    g00 = 0.0
    g01 = 0.0
    g02 = 0.0
    g11 = 0.0
    g12 = 0.0
    g22 = 0.0
    for n in range(count):
        t, x, y = patch[0, n] - mean, patch[1, n] - mean_x, patch[2, n] - mean_y
        patch[0, n], patch[1, n], patch[2, n] = t, x, y
        g00, g01, g02 = g00 + t * t, g01 + t * x, g02 + t * y
        g11, g12, g22 = g11 + x * x, g12 + x * y, g22 + y * y
    if g00 < 1.0:
        return u, v, math.nan
    # The slopes less their part along the patch itself; they must determine the shift in both directions.
    s11, s12, s22 = g11 - g01 * g01 / g00, g12 - g01 * g02 / g00, g22 - g02 * g02 / g00
    least = 0.5 * (s11 + s22 - math.sqrt((s11 - s22) ** 2 + 4.0 * s12 * s12))
    if least < _LEAST_SLOPE:
        return u, v, math.nan
    determinant = s11 * s22 - s12 * s12
    x_now = u
    y_now = v
    likeness = math.nan
    reach = 0.5 * (PATCH - 1)
    for _ in range(_MOST_STEPS):
        left, top = x_now - reach, y_now - reach
        if not (left >= 0.0 and top >= 0.0 and left + PATCH < width and top + PATCH < height):
            return u, v, math.nan
        column, row = int(left), int(top)
        x, y = left - column, top - row
        c00 = (1.0 - x) * (1.0 - y)
        c01 = x * (1.0 - y)
        c10 = (1.0 - x) * y
        c11 = x * y
        a00, a01, a10, a11 = np.float32(c00), np.float32(c01), np.float32(c10), np.float32(c11)
        zero = np.float32(0)
        total = zero
        squares = zero
        r0 = zero
        r1 = zero
        r2 = zero
        for j in range(PATCH):
            start_of_row, n = start + (row + j) * width + column, PATCH * j
            upper = image[start_of_row : start_of_row + PATCH + 1]
            lower = image[start_of_row + width : start_of_row + width + PATCH + 1]
            for i in range(PATCH):
                above = a00 * np.float32(upper[i]) + a01 * np.float32(upper[i + 1])
                value = above + a10 * np.float32(lower[i]) + a11 * np.float32(lower[i + 1])
                total += value
                squares += value * value
                r0 += patch[0, n + i] * value
                r1 += patch[1, n + i] * value
                r2 += patch[2, n + i] * value
        variance = squares - total * total / count
        if variance < 1.0:
            return u, v, math.nan
        likeness = float(r0 / math.sqrt(g00 * variance))
        q1, q2 = r1 - g01 * r0 / g00, r2 - g02 * r0 / g00
        by_x, by_y = (s22 * q1 - s12 * q2) / determinant, (s11 * q2 - s12 * q1) / determinant
        gain = (r0 - g01 * by_x - g02 * by_y) / g00
        if not (gain > _LEAST_GAIN and gain < _MOST_GAIN):
            return u, v, math.nan
        # The image is the patch moved by the shift, so the patch is found where that is taken back.
        step_x, step_y = float(-by_x / gain), float(-by_y / gain)
        x_now, y_now = x_now + step_x, y_now + step_y
        if not ((x_now - u) ** 2 + (y_now - v) ** 2 < _FARTHEST**2):
            return u, v, math.nan
        if step_x * step_x + step_y * step_y < _STILL**2:
            break
    return x_now, y_now, likeness

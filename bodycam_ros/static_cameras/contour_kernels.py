"""The contour of a body in an image: where its projected surface ends, point by point (B 2.3).

Contours are analytic: a point of the contour lies on an edge between a face that a camera sees from outside and one
that it sees from inside. A coarse picture of which segment is in front shows which of them other segments hide, and
beside which the next thing is not the background.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.lens_kernels import project_point, project_point_with_jacobian
from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
Bytes = NDArray[np.uint8]

NOBODY = 255  # as in ``body.surface``, which the build of the kernels cannot import
_NEAREST_M = 0.1  # of a vertex before the camera
_LONGEST_PX = 200.0  # an edge, or a face, that is longer is too near to be a body's
_INWARD, _OUTWARD = 1.0, 1.5  # [pixels of the labels] from the contour, where its own segment, and nobody, must be

POINT = 13
"""Numbers of a contour point: pixel (2), outward normal in the image (2), point in the segment's frame (3), derivative
of the pixel along that normal by the point, in the segment's frame (3) [px/m], pixel where it was found (2), row of its
edge."""


@kernel(
    "(f8[::1], f8[:, :, ::1], f8[:, ::1], i8[::1], i8[:, ::1], f8[:, ::1], f8[::1], i8[::1], i8[:, ::1], i8[:, ::1],"
    " u1[:, ::1], i8, i8, i8, f8, i8)",
)
def find_contour(
    lens: Array,
    camera_T_segment: Array,
    vertices: Array,
    segment_of_vertex: Whole,
    faces: Whole,
    face_normals: Array,
    face_offsets: Array,
    segment_of_face: Whole,
    edges: Whole,
    edge_faces: Whole,
    stands_out: Bytes,
    width: int,
    height: int,
    shrink: int,
    spacing_px: float,
    most: int,
) -> tuple[Array, Whole, Bytes]:
    """Points along the visible contours of all segments, against the background and what differs from them.

    Args:
        lens: of the camera.
        camera_T_segment: (S, 4, 4).
        vertices, segment_of_vertex: (V, 3) in their segments' frames [m], (V,).
        faces, face_normals: (F, 3) vertices, outward normals.
        face_offsets, segment_of_face: (F,) offsets of the faces' planes [m], segments.
        edges, edge_faces: (E, 2) vertices, and the faces on both sides; -1 where there is none.
        stands_out: (S, S) whether the contour of one segment before another counts.
        width, height: of the image [px].
        shrink: how many pixels of the image, across, are one of the labels.
        spacing_px: from point to point.
        most: points at all.

    Returns:
        Points (N, POINT), their segments (N,), and labels (H, W): the segment in front, or ``NOBODY``.
    """
    pixels, depths = _project(lens, camera_T_segment, vertices, segment_of_vertex)
    towards = _towards(camera_T_segment, face_normals, face_offsets, segment_of_face)
    labels = _front(pixels, depths, faces, segment_of_face, towards, width // shrink, height // shrink, shrink)
    points, segments = np.empty((most, POINT)), np.empty(most, np.int64)
    left_over = np.zeros(len(camera_T_segment))
    count = 0
    for edge in range(len(edges)):
        first, second = edge_faces[edge, 0], edge_faces[edge, 1]
        if second >= 0 and towards[first] == towards[second]:
            continue
        a, b = edges[edge, 0], edges[edge, 1]
        along_x, along_y = pixels[b, 0] - pixels[a, 0], pixels[b, 1] - pixels[a, 1]
        length = math.sqrt(along_x * along_x + along_y * along_y)
        if not 1e-6 < length < _LONGEST_PX:  # which NaN is not either
            continue
        segment = segment_of_vertex[a]
        normal_x, normal_y = along_y / length, -along_x / length
        inner = second if second >= 0 and towards[second] else first
        if _lies_towards(pixels, faces, inner, a, normal_x, normal_y):
            normal_x, normal_y = -normal_x, -normal_y
        at = spacing_px - left_over[segment]
        while at <= length and count < most:
            share = at / length
            x, y = pixels[a, 0] + share * along_x, pixels[a, 1] + share * along_y
            inside = label_at(labels, x - _INWARD * shrink * normal_x, y - _INWARD * shrink * normal_y, shrink)
            outside = label_at(labels, x + _OUTWARD * shrink * normal_x, y + _OUTWARD * shrink * normal_y, shrink)
            if inside == segment and is_beside(stands_out, segment, outside):
                point = points[count]
                point[2], point[3] = normal_x, normal_y
                for axis in range(3):
                    point[4 + axis] = vertices[a, axis] + share * (vertices[b, axis] - vertices[a, axis])
                if _place(lens, camera_T_segment[segment], point):
                    point[10], point[11], point[12] = point[0], point[1], edge
                    segments[count] = segment
                    count += 1
            at += spacing_px
        left_over[segment] = length - (at - spacing_px)
    return points[:count].copy(), segments[:count].copy(), labels


@kernel()
def label_at(labels: Bytes, x: float, y: float, shrink: int) -> int:
    """Label of a pixel of the image; -1 outside of it."""
    column, row = int(math.floor((x + 0.5) / shrink)), int(math.floor((y + 0.5) / shrink))
    if column < 0 or row < 0 or row >= labels.shape[0] or column >= labels.shape[1]:
        return -1
    return int(labels[row, column])


@kernel()
def is_beside(stands_out: Bytes, segment: int, label: int) -> bool:
    """Whether what has a label shows where a segment ends: the background does, and segments that differ from it."""
    if label < 0:
        return False
    return label == NOBODY or stands_out[segment, label] != 0


@kernel()
def _project(lens: Array, camera_T_segment: Array, vertices: Array, segments: Whole) -> tuple[Array, Array]:
    """Pixels (V, 2), NaN where the lens has none, and depths (V,) of vertices."""
    pixels, depths = np.empty((len(vertices), 2)), np.empty(len(vertices))
    for vertex in range(len(vertices)):
        T = camera_T_segment[segments[vertex]]
        X, Y, Z = vertices[vertex, 0], vertices[vertex, 1], vertices[vertex, 2]
        x = T[0, 0] * X + T[0, 1] * Y + T[0, 2] * Z + T[0, 3]
        y = T[1, 0] * X + T[1, 1] * Y + T[1, 2] * Z + T[1, 3]
        z = T[2, 0] * X + T[2, 1] * Y + T[2, 2] * Z + T[2, 3]
        depths[vertex] = z
        u, v, valid = project_point(lens, x, y, z)
        is_there = valid and z > _NEAREST_M
        pixels[vertex, 0], pixels[vertex, 1] = (u, v) if is_there else (math.nan, math.nan)
    return pixels, depths


@kernel()
def _towards(camera_T_segment: Array, normals: Array, offsets: Array, segments: Whole) -> NDArray[np.bool_]:
    """Which faces (F,) show their outer side to the camera."""
    towards = np.empty(len(normals), np.bool_)
    cameras = np.empty((len(camera_T_segment), 3))
    for segment in range(len(camera_T_segment)):
        T = camera_T_segment[segment]
        for axis in range(3):
            cameras[segment, axis] = -(T[0, axis] * T[0, 3] + T[1, axis] * T[1, 3] + T[2, axis] * T[2, 3])
    for face in range(len(normals)):
        n, c = normals[face], cameras[segments[face]]
        towards[face] = n[0] * c[0] + n[1] * c[1] + n[2] * c[2] > offsets[face]
    return towards


@kernel()
def _front(
    pixels: Array,
    depths: Array,
    faces: Whole,
    segments: Whole,
    towards: NDArray[np.bool_],
    width: int,
    height: int,
    shrink: int,
) -> Bytes:
    """Labels (height, width) of what is in front: a depth buffer at a part of the image's resolution."""
    labels = np.full((height, width), NOBODY, np.uint8)
    depth = np.full((height, width), math.inf)
    scale, shift = 1.0 / shrink, 0.5 / shrink - 0.5
    longest = _LONGEST_PX * scale
    for face in range(len(faces)):
        if not towards[face]:
            continue
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        ax, ay = pixels[a, 0] * scale + shift, pixels[a, 1] * scale + shift
        bx, by = pixels[b, 0] * scale + shift, pixels[b, 1] * scale + shift
        cx, cy = pixels[c, 0] * scale + shift, pixels[c, 1] * scale + shift
        low_x, high_x = min(ax, bx, cx), max(ax, bx, cx)
        low_y, high_y = min(ay, by, cy), max(ay, by, cy)
        if not (high_x - low_x < longest and high_y - low_y < longest):  # nor NaN
            continue
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area == 0.0:
            continue
        per_area = 1.0 / area
        for row in range(max(0, int(math.ceil(low_y))), min(height - 1, int(math.floor(high_y))) + 1):
            for column in range(max(0, int(math.ceil(low_x))), min(width - 1, int(math.floor(high_x))) + 1):
                of_a = ((bx - column) * (cy - row) - (cx - column) * (by - row)) * per_area
                of_b = ((cx - column) * (ay - row) - (ax - column) * (cy - row)) * per_area
                of_c = 1.0 - of_a - of_b
                if of_a >= -1e-9 and of_b >= -1e-9 and of_c >= -1e-9:
                    z = of_a * depths[a] + of_b * depths[b] + of_c * depths[c]
                    if z < depth[row, column]:
                        depth[row, column], labels[row, column] = z, segments[face]
    return labels


@kernel()
def _lies_towards(pixels: Array, faces: Whole, face: int, a: int, normal_x: float, normal_y: float) -> bool:
    """Whether a face lies on the side of one of its vertices to which a direction points."""
    side = 0.0
    for corner in range(3):
        vertex = faces[face, corner]
        side += normal_x * (pixels[vertex, 0] - pixels[a, 0]) + normal_y * (pixels[vertex, 1] - pixels[a, 1])
    return side > 0.0


@kernel("(f8[::1], f8[:, :, ::1], f8[:, ::1], i8[::1])")
def carry_contour(lens: Array, camera_T_segment: Array, points: Array, segments: Whole) -> tuple[Array, Whole]:
    """Contour points where their segments have moved a little since they were found, along the normals they had.

    The contour then runs along other points of the surface, but these lie across the line of sight from the same.

    Args:
        lens: of the camera.
        camera_T_segment: (S, 4, 4) where the segments are now.
        points, segments: (N, POINT), (N,) of ``find_contour``.

    Returns:
        Points and segments, without those that have left the lens.
    """
    carried, remaining = points.copy(), segments.copy()
    count = 0
    for n in range(len(points)):
        carried[count] = points[n]
        if _place(lens, camera_T_segment[segments[n]], carried[count]):
            remaining[count] = segments[n]
            count += 1
    return carried[:count].copy(), remaining[:count].copy()


@kernel()
def _place(lens: Array, camera_T_segment: Array, point: Array) -> bool:
    """Fill in a contour point's pixel, and its motion along its normal with the point; whether the lens projects it."""
    T = camera_T_segment
    x = T[0, 0] * point[4] + T[0, 1] * point[5] + T[0, 2] * point[6] + T[0, 3]
    y = T[1, 0] * point[4] + T[1, 1] * point[5] + T[1, 2] * point[6] + T[1, 3]
    z = T[2, 0] * point[4] + T[2, 1] * point[5] + T[2, 2] * point[6] + T[2, 3]
    u, v, valid, u_x, u_y, u_z, v_x, v_y, v_z = project_point_with_jacobian(lens, x, y, z)
    if not valid:
        return False
    point[0], point[1] = u, v
    along_x = point[2] * u_x + point[3] * v_x
    along_y = point[2] * u_y + point[3] * v_y
    along_z = point[2] * u_z + point[3] * v_z
    for axis in range(3):
        point[7 + axis] = T[0, axis] * along_x + T[1, axis] * along_y + T[2, axis] * along_z
    return True

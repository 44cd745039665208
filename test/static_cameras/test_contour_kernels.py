"""Contours of balls and limbs against what geometry says of them, through OpenCV's lenses."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from static_cameras.painted_scene import Painted, opencv_pixels, painted_labels
from static_cameras.silhouettes import (
    LENSES,
    SHRINK,
    SPACING_PX,
    at,
    ball,
    beside,
    contour,
    depth_within,
    inside,
    largest_gap,
    rim_of_ball,
    surface_of,
)

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.limb_mesh import Ball, capsule_surfaces, limb_mesh
from bodycam_ros.body.surface import BodySurface, Surface
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_so3, rigid, transform_points
from bodycam_ros.static_cameras.contour_kernels import NOBODY, POINT


@pytest.fixture(params=LENSES)
def lens(request: pytest.FixtureRequest) -> CameraModel:
    return LENSES[request.param]


CENTRES = [(0.1, -0.05, 1.5), (0.9, 0.4, 1.6), (-0.5, 0.45, 1.3)]


@pytest.mark.parametrize("centre", CENTRES)
def test_the_contour_of_a_ball_is_where_rays_touch_it(lens: CameraModel, centre: tuple[float, float, float]) -> None:
    radius = 0.2
    points, segments, _ = contour(lens, surface_of(ball=ball(radius)), at(centre))
    rim = opencv_pixels(lens, rim_of_ball(np.array(centre), radius))
    visible = rim[((rim > 4) & (rim < [lens.width - 5, lens.height - 5])).all(axis=1)]
    assert largest_gap(visible, points[:, :2]) < 1.5 * SPACING_PX
    off, normals = beside(rim, points[:, :2])
    assert np.abs(off).max() < 0.3
    assert (points[:, 2:4] * normals).sum(axis=1).min() > np.cos(np.radians(6.0))
    np.testing.assert_allclose(np.linalg.norm(points[:, 2:4], axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(
        opencv_pixels(lens, transform_points(at(centre)[0], points[:, 4:7])), points[:, :2], atol=0.1
    )
    assert points.shape[1] == POINT and (segments == 0).all()


def test_the_contour_of_a_limb_is_the_hull_of_those_of_its_balls(lens: CameraModel) -> None:
    """A tapered capsule is the convex hull of two balls, and so is its picture before the lens bends it."""
    start, end = np.array([-0.3, -0.2, 1.6]), np.array([0.25, 0.2, 1.9])
    limb = Surface(*limb_mesh(start, end, [Ball(0.0, 0.09), Ball(1.0, 0.05)], np.eye(3)[0]))
    points, _, _ = contour(lens, surface_of(limb=limb), np.eye(4)[None])
    rims = np.concatenate([rim_of_ball(start, 0.09), rim_of_ball(end, 0.05)])
    hull = cv2.convexHull((rims[:, :2] / rims[:, 2:]).astype(np.float32)).reshape(-1, 2).astype(float)
    closed = np.concatenate([hull, hull[:1]])
    dense = np.concatenate([a + np.linspace(0, 1, 60)[:, None] * (b - a) for a, b in pairwise(closed)])
    line = opencv_pixels(lens, np.column_stack([dense, np.ones(len(dense))]))
    line = line[np.concatenate([np.linalg.norm(np.diff(line, axis=0), axis=1) > 1e-6, [True]])]
    off, normals = beside(line, points[:, :2])
    assert np.abs(off).max() < 0.5
    assert (points[:, 2:4] * normals).sum(axis=1).min() > np.cos(np.radians(15.0))
    assert largest_gap(line, points[:, :2]) < 1.5 * SPACING_PX


def test_the_derivative_is_that_of_the_pixel_along_the_normal(lens: CameraModel) -> None:
    pose = at(CENTRES[2])
    points, _, _ = contour(lens, surface_of(ball=ball(0.2)), pose)
    step = 1e-6
    for axis in range(3):
        ends = [
            opencv_pixels(lens, transform_points(pose[0], points[:, 4:7] + h * np.eye(3)[axis])) for h in (step, -step)
        ]
        numeric = ((ends[0] - ends[1]) / (2.0 * step) * points[:, 2:4]).sum(axis=1)
        np.testing.assert_allclose(points[:, 7 + axis], numeric, atol=1e-3 * np.abs(points[:, 7:10]).max())


NEAR, FAR = (0.1, 0.05, 1.3), (-0.05, 0.0, 2.0)


def test_what_is_nearer_hides_a_contour_and_counts_where_it_stands_out(lens: CameraModel) -> None:
    surface, poses = surface_of(far=ball(0.25), near=ball(0.12)), at(FAR, NEAR)
    rims = [opencv_pixels(lens, rim_of_ball(np.array(c), r)) for c, r in ((FAR, 0.25), (NEAR, 0.12))]
    hidden = inside(rims[1], rims[0])
    before_far = inside(rims[0], rims[1])
    assert hidden.any() and not hidden.all() and before_far.any() and not before_far.all()

    points, segments, _ = contour(lens, surface, poses)
    far, near = points[segments == 0, :2], points[segments == 1, :2]
    assert not inside(rims[1], far).any()
    assert largest_gap(rims[0][~hidden], far) < 3.0 * SPACING_PX  # fewer where both rims meet
    assert depth_within(rims[0], near).max() < 2.0 * SHRINK  # none before the other, but for the labels' pixels
    assert largest_gap(rims[1][~before_far], near) < 3.0 * SPACING_PX

    points, segments, _ = contour(lens, surface, poses, before=((1, 0),))
    assert largest_gap(rims[1], points[segments == 1, :2]) < 1.5 * SPACING_PX
    assert not inside(rims[1], points[segments == 0, :2]).any()

    points, segments, _ = contour(lens, surface, poses, before=((0, 1),))  # which is never before the other
    assert depth_within(rims[0], points[segments == 1, :2]).max() < 2.0 * SHRINK
    assert not inside(rims[1], points[segments == 0, :2]).any()


@pytest.fixture(scope="module")
def body(sample) -> BodyModel:
    return read_body(sample / "body.yaml")


@pytest.mark.parametrize("seed", range(3))
def test_labels_are_what_a_painter_shows(lens: CameraModel, body: BodyModel, seed: int) -> None:
    """But at borders, where pixels are rounded, and where limbs grow into each other."""
    random = np.random.default_rng(seed)
    surfaces = capsule_surfaces(body)
    standing = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # looks along x, at z up
    root = rigid(standing @ exp_so3(np.array([0.0, 0.0, random.uniform(-3, 3)])), np.array([0.1, 0.0, lens.fx / 160.0]))
    poses = body.forward_kinematics(root, exp_so3(random.normal(0.0, 0.35, (len(body.tree_joints), 3))))
    _, _, labels = contour(lens, BodySurface.of(body, surfaces), poses)
    things = [
        Painted(
            transform_points(poses[row], surfaces[name].vertices),
            surfaces[name].faces,
            np.full((len(surfaces[name].faces), 1), row),
        )
        for row, name in enumerate(body.segments)
    ]
    truth = painted_labels(lens, np.eye(4), things, SHRINK, NOBODY)
    around = np.ones((5, 5), np.uint8)
    certain = cv2.erode(truth, around) == cv2.dilate(truth, around)
    assert (truth[certain] != NOBODY).sum() > 1000
    assert len(np.unique(truth[certain])) > 7
    assert (labels[certain] != truth[certain]).mean() < 1e-3
    assert ((labels == NOBODY) != (truth == NOBODY)).sum() < 0.1 * (truth != NOBODY).sum()


@pytest.mark.parametrize(
    "place",
    [(0.1, -0.05, -1.5), (0.0, 0.0, 0.05), (0.02, 0.0, 0.19), (0.5, 0.3, 0.1), (1e4, 0.0, 1.0), (0.0, 0.0, -1e-9)],
    ids=["behind", "around", "before the face", "beside", "out of sight", "in the middle"],
)
def test_a_segment_behind_or_around_the_camera_does_no_harm(
    lens: CameraModel, place: tuple[float, float, float]
) -> None:
    alone, alone_segments, _ = contour(lens, surface_of(seen=ball(0.2), odd=ball(0.2)), at(CENTRES[0], (0, 0, -9.0)))
    assert set(alone_segments) == {0}
    points, segments, _ = contour(lens, surface_of(seen=ball(0.2), odd=ball(0.2)), at(CENTRES[0], place))
    assert np.isfinite(points).all()
    np.testing.assert_allclose(np.linalg.norm(points[:, 2:4], axis=1), 1.0, atol=1e-9)
    assert ((points[:, :2] > -1.0) & (points[:, :2] < [lens.width, lens.height])).all()
    seen = points[segments == 0]
    assert len(seen) <= len(alone)
    for x, y in seen[:, :2]:
        assert np.abs(alone[:, :2] - [x, y]).sum(axis=1).min() < 1e-9
    if place[2] < 0.1:
        assert len(seen) == len(alone)

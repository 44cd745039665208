"""What contours say of lengths, girths and bulges, against differences of the body itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from static_cameras.dressed_body import small_motion, static_cameras_around
from static_cameras.painted_scene import opencv_pixels

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_shape import BodyShape, ShapeSettings
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.shape_evidence import BULGES, ShapeEvidence
from bodycam_ros.static_cameras.static_camera import Contour, RegionEvidence, RegionModel, StaticCamera

SETTINGS = RegionSettings()
BLACK = np.zeros((480, 640, 3), np.uint8)


@dataclass(frozen=True, eq=False)
class KnowingView:
    """A view whose lines find the contour where points of the surface have really gone."""

    view: RegionModel
    station: StaticCamera
    now: ShapeEvidence
    then: ShapeEvidence
    poses_then: Array

    def find_contour(self, poses: Array) -> Contour:
        return self.view.find_contour(poses)

    def measure(self, image: NDArray[np.uint8], contour: Contour, stride: int) -> RegionEvidence:
        points, segments = contour.points, contour.segments
        first, second = self.now.surface.edges[points[:, 12].astype(int)].T
        start, end = self.now.surface.vertices[first], self.now.surface.vertices[second]
        share = ((points[:, 4:7] - start) * (end - start)).sum(axis=1) / ((end - start) ** 2).sum(axis=1)
        np.testing.assert_allclose(start + share[:, None] * (end - start), points[:, 4:7], atol=1e-9)
        vertices = self.then.surface.vertices
        moved = vertices[first] + share[:, None] * (vertices[second] - vertices[first])
        camera_T_world = inverse(self.station.world_T_camera)
        in_camera = np.stack(
            [
                transform_points(camera_T_world @ self.poses_then[row], point[None])[0]
                for row, point in zip(segments, moved, strict=True)
            ]
        )
        pixels = opencv_pixels(self.station.camera, in_camera)
        along = ((pixels - points[:, :2]) * points[:, 2:4]).sum(axis=1)
        size = len(self.poses_then)
        lines = np.bincount(segments, minlength=size)
        empty = np.zeros((size, 6, 6)), np.zeros((size, 6))
        return RegionEvidence(*empty, lines, along, np.ones(len(points)), lines)


@pytest.fixture(scope="module")
def shape(sample: Path) -> BodyShape:
    return BodyShape(read_body(sample / "body.yaml"), ShapeSettings())


@pytest.fixture(scope="module")
def names(shape: BodyShape) -> list[str]:
    return [f"{joint.name} {'xyz'[axis]}" for joint, axis in shape.lengths] + shape.thick


@pytest.fixture(scope="module")
def before(shape: BodyShape, names: list[str]) -> Array:
    """What lasts: an arm is longer than it was begun with."""
    lasting = np.zeros(shape.size + BULGES * len(shape.thick))
    lasting[names.index("elbow_left z")] = 0.03
    return lasting


@pytest.fixture(scope="module")
def now(shape: BodyShape, before: Array) -> ShapeEvidence:
    return ShapeEvidence(shape, before, SETTINGS)


def said(now: ShapeEvidence, then: ShapeEvidence) -> tuple[Array, Array, Array]:
    """Information and vector of an instant at which what lasts is otherwise, and the vector where it is as taken."""
    (poses,) = small_motion(now.body, 1)
    rotations = now.body.joint_rotations(poses)
    root = poses[now.body.segment_index[now.body.root]]
    stations = static_cameras_around(2)
    views: Mapping[str, RegionModel] = RegionTracker(now.body, now.surface, stations, SETTINGS).views
    vectors = []
    for shown in (then, now):
        moved = shown.body.forward_kinematics(root, rotations)
        knowing = {name: KnowingView(view, stations[name], now, shown, moved) for name, view in views.items()}
        information, vector = now.measure(knowing, dict.fromkeys(stations, BLACK), poses)  # type: ignore[arg-type]
        vectors.append(vector)
    return information, vectors[0], vectors[1]


@pytest.mark.parametrize(
    ("what", "tolerance"),
    [
        ("knee_left z", 1e-3),
        ("shoulder_right y", 1e-3),
        ("thigh_left", 1e-3),
        ("bulges", 0.1),  # vertices move along normals of their own, a contour along that of an edge
    ],
)
def test_what_is_said_is_what_has_changed(
    shape: BodyShape, names: list[str], before: Array, now: ShapeEvidence, what: str, tolerance: float
) -> None:
    """Vector = information x change, to first order: the step is the change, where anything tells it."""
    change = np.zeros_like(before)
    if what == "bulges":
        change[shape.size :] = np.random.default_rng(2).normal(0.0, 1e-5, len(before) - shape.size)
    else:
        change[names.index(what)] = 1e-4
    information, vector, unchanged = said(now, ShapeEvidence(shape, before + change, SETTINGS))
    expected = information @ change
    off = np.linalg.norm(vector - unchanged - expected) / np.linalg.norm(expected)
    print(f"{what}: {off:.4f}")
    assert off < tolerance
    np.testing.assert_allclose(information, information.T, atol=1e-6 * np.abs(information).max())
    assert np.linalg.eigvalsh(information).min() > -1e-6 * np.abs(information).max()

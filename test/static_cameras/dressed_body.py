"""A person in plain clothes before clutter, as stations see one: pictures by ``painted_scene``, every pose known."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from static_cameras.painted_scene import Painted, clutter, grained, paint

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.body.surface import Surface
from bodycam_ros.camera import camera_from_info
from bodycam_ros.geometry import exp_so3, rigid, transform_points
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.static_cameras.static_camera import StaticCamera

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

CLOTHES = {
    "pelvis": (150, 60, 40), "torso": (40, 40, 190), "head": (130, 160, 210), "upper_arm": (40, 190, 200),
    "forearm": (130, 160, 210), "thigh": (150, 60, 40), "shin": (60, 130, 50), "foot": (40, 40, 40),
    "hand": (130, 160, 210),
}  # fmt: skip
"""Blue, green, red of each kind of segment."""

MIDDLE = np.array([0.0, 0.0, 0.95])


@dataclass(frozen=True, eq=False)
class DressedBody:
    """What stands before the stations.

    Attributes:
        body, surfaces: what it looks like.
        stations: that see it.
    """

    body: BodyModel
    surfaces: Mapping[str, Surface]
    stations: Mapping[str, StaticCamera]

    def images(self, world_T_segment: Array, light: float, seed: int) -> dict[str, Image]:
        """One of each station; each has its own background, which does not change but for its light and its grain."""
        random, shades = np.random.default_rng(seed), np.random.default_rng(0)
        things = []
        for row, name in enumerate(self.body.segments):
            surface = self.surfaces[name]
            # Faces differ, as cloth and the light on it do.
            shade = shades.uniform(0.85, 1.15, (len(surface.faces), 1))
            colours = light * shade * np.array(CLOTHES[SegmentName(name).kind])
            vertices = transform_points(world_T_segment[row], surface.vertices)
            things.append(Painted(vertices, surface.faces, colours))
        pictures = {}
        for number, (name, station) in enumerate(self.stations.items()):
            camera = station.camera
            background = (light * clutter(camera.width, camera.height, number)).astype(np.uint8)
            pictures[name] = grained(paint(camera, station.world_T_camera, background, things), random)
        return pictures


def static_cameras_around(count: int) -> dict[str, StaticCamera]:
    """VGA cameras three metres from where the person stands, as far apart as they can be."""
    stations = {}
    for number in range(count):
        angle, name = 0.5 + 2.0 * np.pi * number / count, f"ext_{number:02d}"
        camera = camera_from_info(
            name, 640, 480, "plumb_bob", [-0.03, 0.01, 0, 0, 0], [470, 0, 318.3, 0, 470, 240.7, 0, 0, 1]
        )
        place = MIDDLE + [3.0 * np.cos(angle), 3.0 * np.sin(angle), 0.3 + 0.2 * number]
        stations[name] = StaticCamera(name, looking_at(place, MIDDLE), camera)
    return stations


def looking_at(place: Array, aim: Array) -> Array:
    """(4, 4) an optical frame at a place, upright, that looks at another."""
    forward = (aim - place) / np.linalg.norm(aim - place)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return rigid(np.column_stack([right, np.cross(forward, right), forward]), place)


def small_motion(body: BodyModel, frames: int, share: float = 0.15) -> Array:
    """(T, S, 4, 4) every joint turns within a share of its limits, some degrees a frame; the root goes a centimetre."""
    random, angles = np.random.default_rng(11), JointAngles(body)
    low, high = np.array([limits for joint in body.tree_joints for limits in joint.limits or ()]).T
    swing = share * np.minimum(high - low, 1.5)
    centre = np.clip([_AWAY.get(name, 0.0) for name in angles.names], low + swing, high - swing)
    phase = 0.12 * np.arange(frames)[:, None]
    turns = centre + swing * np.sin(random.uniform(0.0, 2.0 * np.pi, len(swing)) + phase)
    slow = phase[:, 0]
    root = rigid(
        exp_so3(np.column_stack([0.05 * np.sin(slow), 0.05 * np.cos(slow), 0.2 * np.sin(slow)])),
        MIDDLE + np.column_stack([0.1 * np.sin(slow), 0.06 * slow, 0.02 * np.cos(2.0 * slow)]),
    )
    return body.forward_kinematics(root, angles.rotations(turns))


_AWAY = {"shoulder_left_x": 0.5, "shoulder_right_x": -0.5, "hip_left_x": 0.15, "hip_right_x": -0.15}
"""Joint angle -> [rad] limbs a little away from the trunk."""

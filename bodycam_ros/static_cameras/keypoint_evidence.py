"""Keypoints of one person in the images of a frame, as measurements of the body (``JointKeypoints``).

In each image the person is taken that is nearest to the body as predicted. Of each joint the keypoints count that agree
with the point that the most cameras agree on; what is elsewhere (left for right, another person's) is rejected.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import JOINT_ABOVE, LEFT, RIGHT
from bodycam_ros.estimation.factors.joint_keypoints import JointKeypoints
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, PredictedBody
from bodycam_ros.static_cameras.static_camera import Image, StaticCamera
from bodycam_ros.static_cameras.triangulated_joints import INLIER, LEAST_SCORE, triangulate_people

SIGMA_M = 0.04
"""Sigma of a keypoint, as a length at the joint's distance [m]: a detector's errors grow with the person's size."""

FAR_M = 0.15
"""From a joint of the body to where cameras agree that it is [m], from which on it was lost."""

_STEPS = 5  # to where keypoints have a limb that was lost
_KINDS = {joint.capitalize(): kind for kind, joint in JOINT_ABOVE.items()}
_SIDES = {"L": LEFT, "R": RIGHT}
_NEAR_M = 1.0  # from the predicted body, as a length at its distance, from which on a person is another

People = Sequence[Array]
"""(J, 3) pixel and score of the joints of each person in an image."""


class KeypointSource(Protocol):
    """People in images of static cameras."""

    def people(self, camera: str, stamp_ns: int, image: Image, near: Array) -> People:
        """People in an image.

        Args:
            camera: its name.
            stamp_ns: when it was taken [ns].
            image: (H, W, 3) blue, green, red.
            near: (J, 2) about where the joints of the person are [px], NaN of those that are not in the lens's cone.
        """


@dataclass(frozen=True)
class RecordedPeople(KeypointSource):
    """People that were detected before.

    Attributes:
        by_stamp: camera -> stamp of an image [ns] -> people in it.
    """

    by_stamp: Mapping[str, Mapping[int, People]]

    def people(self, camera: str, stamp_ns: int, image: Image, near: Array) -> People:
        """See ``KeypointSource``."""
        return self.by_stamp.get(camera, {}).get(stamp_ns, ())


@dataclass(frozen=True, eq=False)
class AgreedKeypoints:
    """The keypoints of a frame that agree.

    Attributes:
        keypoints: of all cameras.
        segments: (N,) rows of the segments whose origins at least two cameras agree on.
        places: (N, 3) of these in the world [m].
    """

    keypoints: JointKeypoints
    segments: NDArray[np.int64]
    places: Array

    @staticmethod
    def nothing() -> "AgreedKeypoints":
        """No keypoints in a frame."""
        return AgreedKeypoints(JointKeypoints.nothing(), np.zeros(0, np.int64), np.zeros((0, 3)))

    def far_from(self, poses: Array) -> NDArray[np.bool_]:
        """(S,) segments whose origins, at poses (S, 4, 4), are elsewhere than cameras agree."""
        far = np.zeros(len(poses), bool)
        far[self.segments] = np.linalg.norm(poses[self.segments, :3, 3] - self.places, axis=1) > FAR_M
        return far

    def move_limbs(
        self, step: ArticulatedStep, poses: Array, near: PredictedBody, far: NDArray[np.bool_]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Poses (S, 4, 4) with the joints where keypoints have them, and the segments (S,) that were elsewhere.

        Args:
            step: of the body.
            poses: (S, 4, 4), of which some origins are far (S,) from the keypoints.
            near: prediction about these.
            far: (S,) which; a segment is elsewhere where either of its ends is.
        """
        moved = poses
        for _ in range(_STEPS):
            moved = step.apply(moved, *self.keypoints.equations(moved), near)
        parents, children = step.body.joint_ends.T
        ends = far.copy()
        ends[parents[far[children]]] = True
        return moved, ends

    def without(self, segments: NDArray[np.bool_]) -> "AgreedKeypoints":
        """The same without the keypoints of some segments (S,)."""
        kept = ~segments[self.segments]
        keypoints = self.keypoints[~segments[self.keypoints.segments]]
        return AgreedKeypoints(keypoints, self.segments[kept], self.places[kept])


class KeypointEvidence:
    """Keypoints of a recording.

    Args:
        body: whose joints they are.
        stations: static cameras, by name.
        joints: names of the keypoints' J joints, as ``formats.keypoints.JOINTS``.
        source: of the people in each image.
    """

    def __init__(
        self,
        body: BodyModel,
        stations: Mapping[str, StaticCamera],
        joints: Sequence[str],
        source: KeypointSource,
    ) -> None:
        names = [_KINDS[joint[1:]] + _SIDES[joint[0]] for joint in joints]
        self._rows = np.array([body.segment_index.get(name, -1) for name in names], np.int64)
        self._stations, self._source = stations, source
        self._numbers = {name: number for number, name in enumerate(stations)}
        self._views = {name: (station.camera, station.world_T_camera) for name, station in stations.items()}

    def agreed(self, images: Mapping[str, Image], stamps_ns: Mapping[str, int], poses: Array) -> AgreedKeypoints:
        """The keypoints of images with their stamps [ns], by camera, of the body that is near poses (S, 4, 4)."""
        places = np.where((self._rows >= 0)[:, None], poses[self._rows, :3, 3], np.nan)
        nearest = {}
        for name, image in images.items():
            seen, focal = _projected(self._stations[name], places)
            people = self._source.people(name, stamps_ns[name], image, seen)
            apart = [_apart_m(person, seen, focal) for person in people]
            if apart and min(apart) < _NEAR_M:
                nearest[name] = people[int(np.argmin(apart))]
        found = triangulate_people(self._stations, {name: [person] for name, person in nearest.items()})
        if not found:
            return AgreedKeypoints.nothing()
        points, _ = found[0]
        known = np.isfinite(points).all(axis=1) & (self._rows >= 0)
        parts = [self._of(name, person, points, known) for name, person in nearest.items()]
        cameras, rows, pixels, sigmas = (np.concatenate(each) for each in zip(*parts, strict=True))
        keypoints = JointKeypoints(self._views, cameras, self._rows[rows], pixels, sigmas)
        return AgreedKeypoints(keypoints, self._rows[known], points[known])

    def _of(
        self, name: str, person: Array, points: Array, known: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
        """Cameras, rows of joints, pixels and sigmas of a camera's keypoints that agree with points (J, 3)."""
        station = self._stations[name]
        seen, focal = _projected(station, points)
        off = np.linalg.norm(seen - person[:, :2], axis=1) / (INLIER * max(station.camera.width, station.camera.height))
        rows = np.flatnonzero(known & (person[:, 2] >= LEAST_SCORE) & (off < 1.0))
        return np.full(len(rows), self._numbers[name]), rows, person[rows, :2], SIGMA_M * focal[rows]


def _projected(station: StaticCamera, points: Array) -> tuple[Array, Array]:
    """Pixels (J, 2) of points (J, 3), NaN where invalid, and pixels of a metre there (J,)."""
    in_camera = transform_points(inverse(station.world_T_camera), np.nan_to_num(points))
    seen, valid = station.camera.project(in_camera)
    valid = valid & np.isfinite(points).all(axis=1)
    focal = 0.5 * (station.camera.fx + station.camera.fy) / np.maximum(np.linalg.norm(in_camera, axis=1), 1e-3)
    return np.where(valid[:, None], seen, np.nan), focal


def _apart_m(person: Array, seen: Array, focal: Array) -> float:
    """Median distance of a person's keypoints from joints at pixels (J, 2), (J,) pixels of a metre there [m]."""
    off = np.linalg.norm(seen - person[:, :2], axis=1) / focal
    off = off[(person[:, 2] >= LEAST_SCORE) & np.isfinite(off)]
    return float(np.median(off)) if len(off) else np.inf

"""What some cameras saw at one instant, with what the solved body and the map say that they should have seen."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.evaluate.read_solved import LANDMARKS
from bodycam_ros.evaluate.solved_recording import CameraRecord, SolvedRecording
from bodycam_ros.evaluate.stick_figure import bones
from bodycam_ros.evaluate.trajectory import interpolated
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches

CAMERAS = 6
"""Cameras that are shown, spread over the body."""

_LATEST_S = 20.0
"""The instant is the recording's middle, but no later than this: bags are read from their start."""

_POINTS_PER_BONE = 40  # a straight line is bent in a fisheye image


@dataclass(frozen=True, eq=False)
class OverlayView:
    """One image.

    Attributes:
        camera: name.
        seconds: since the start of the recording.
        registered: whether the camera knew its own pose.
        image: (H, W) grey.
        pixels: (N, 2) where the named tracks are [px].
        projected: (N, 2) where their landmarks fall in the solved pose [px]; NaN outside the lens.
        limbs: (segment, (K, 2) pixels of a bone in the solved pose); NaN outside the lens.
    """

    camera: str
    seconds: float
    registered: bool
    image: NDArray[np.uint8]
    pixels: Array
    projected: Array
    limbs: tuple[tuple[str, Array], ...]

    @property
    def errors(self) -> Array:
        """(N,) distances between tracks and landmarks [px]."""
        distances: Array = np.linalg.norm(self.projected - self.pixels, axis=1)
        return distances


def overlay_views(solved: SolvedRecording, recording: Path) -> tuple[OverlayView, ...]:
    """The views of some cameras at one instant in the middle of the recording.

    Args:
        solved: the body.
        recording: the bag that it was solved from.

    Raises:
        RecordingError: not a recording, or an image that cannot be decoded.
        LensError: the recording's intrinsics cannot be used.
    """
    middle_ns = min((solved.start_ns + solved.end_ns) // 2, solved.start_ns + round(1e9 * _LATEST_S))
    at_ns = int(solved.stamps_ns[np.argmin(np.abs(solved.stamps_ns - middle_ns))])
    with open_recording(recording) as images:
        known = [(record, poses) for record, poses in solved.solved_cameras() if record.camera in images.cameras]
        rows = np.unique(np.linspace(0, len(known) - 1, min(CAMERAS, len(known))).round().astype(int))
        found = [(*known[row], _image_at(images, known[row][0].camera, at_ns, solved.frame_ns)) for row in rows]
        return tuple(
            _view(solved, record, poses, image, images.camera_model(record.camera))
            for record, poses, image in found
            if image is not None and image.stamp_ns in record.stamps_ns
        )


def _image_at(images: Recording, camera: str, at_ns: int, frame_ns: int) -> CameraImage | None:
    """The camera's image within half a frame of a time, if there is one."""
    for image in images.images([camera]):
        if image.stamp_ns >= at_ns - frame_ns // 2:
            return image if image.stamp_ns <= at_ns + frame_ns // 2 else None
    return None


def _view(
    solved: SolvedRecording, record: CameraRecord, poses: Array, image: CameraImage, model: CameraModel
) -> OverlayView:
    at_ns = np.clip(np.array([image.stamp_ns]), solved.stamps_ns[0], solved.stamps_ns[-1])
    camera_T_world = inverse(_pose_at(solved, poses, at_ns))
    matches = _matches_at(solved, record.camera, image.stamp_ns)
    projected, _ = model.project(transform_points(camera_T_world, matches.points_world.astype(np.float64)))
    body = {s: _pose_at(solved, solved.world_T_link[s], at_ns)[None] for s in solved.urdf.segments}
    along = np.linspace(0.0, 1.0, _POINTS_PER_BONE)[:, None]
    limbs = []
    for bone in bones(body, solved.urdf.parent_segments()):
        points_world = (1.0 - along) * bone.start + along * bone.end
        limbs.append((bone.segment, model.project(transform_points(camera_T_world, points_world))[0]))
    return OverlayView(
        camera=record.camera,
        seconds=float(solved.seconds(np.array([image.stamp_ns]))[0]),
        registered=matches.world_T_camera is not None,
        image=decode_grey(image),
        pixels=matches.pixels.astype(np.float64),
        projected=projected,
        limbs=tuple(limbs),
    )


def _pose_at(solved: SolvedRecording, poses: Array, at_ns: NDArray[np.int64]) -> Array:
    pose: Array = poses[0] if len(poses) == 1 else interpolated(solved.stamps_ns, poses, at_ns)[0]
    return pose


def _matches_at(solved: SolvedRecording, camera: str, stamp_ns: int) -> LandmarkMatches:
    with BagFile(solved.path) as bag:
        stream = (landmark_matches(m, camera) for _, _, m in bag.messages([f"/{camera}{LANDMARKS}"]))
        return next(matches for matches in stream if matches.stamp_ns == stamp_ns)

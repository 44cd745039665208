"""Poses of all cameras of a range of motion at common stamps, in bounded memory."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.camera_path import path_points
from bodycam_ros.timing.stamps import find_shared_stamps

_SHORTEST_INTERVAL_NS = 1_000_000_000 // 480  # shorter than the time between two images
_MAX_IMAGES = 2400  # per camera, about 3 kB each: a minute and a half at 25 Hz; of a longer recording fewer a second
_MAX_GAP_S = 0.15  # between two registrations that are interpolated; beyond, a limb's path bends by centimetres


class CameraLog:
    """The registrations of one camera, thinned evenly over time once there are too many.

    Args:
        camera: its name.
    """

    def __init__(self, camera: str) -> None:
        self.camera = camera
        self.matches: list[LandmarkMatches] = []
        self.images = 0
        self.registered = 0
        self._interval_ns = _SHORTEST_INTERVAL_NS

    def add(self, matches: LandmarkMatches) -> None:
        """Add the next image's registration; one that is not later than the last is dropped."""
        if self.matches and matches.stamp_ns <= self.matches[-1].stamp_ns:
            return
        self.images += 1
        self.registered += matches.world_T_camera is not None
        last_ns = self.matches[-1].stamp_ns if self.matches else -1
        if matches.stamp_ns // self._interval_ns > last_ns // self._interval_ns:
            self.matches.append(matches)
        while len(self.matches) > _MAX_IMAGES:
            # The first image in each interval of absolute time: all cameras keep the same ones.
            self._interval_ns *= 2
            first: dict[int, LandmarkMatches] = {}
            for each in self.matches:
                first.setdefault(each.stamp_ns // self._interval_ns, each)
            self.matches = list(first.values())


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """Poses of all cameras at common stamps.

    Attributes:
        cameras: (C) names.
        stamps_ns: (T) [ns], those of the camera that was registered most often.
        world_T_camera: (T, C, 4, 4); the identity where a camera is unknown.
        known: (T, C) whether it is known.
        matches: (T) camera -> the image nearest to the stamp, with its landmarks; registered ones only.
        frame_T_image: (T, C, 4, 4) pose of the camera when it took that image, in its frame at the stamp: the
            identity where all cameras are triggered together.
        twists: (T, C, 6) of the cameras, rotation [rad/s] then translation [m/s] in their own axes.
        triggered: (C) whether a camera shares its stamps with most others.
        start_ns: stamp of the recording's time 0 [ns].
    """

    cameras: tuple[str, ...]
    stamps_ns: NDArray[np.int64]
    world_T_camera: Array
    known: NDArray[np.bool_]
    matches: tuple[Mapping[str, LandmarkMatches], ...]
    frame_T_image: Array
    twists: Array
    triggered: NDArray[np.bool_]
    start_ns: int

    @property
    def seconds(self) -> Array:
        """(T) stamps in the recording's time, since its first image [s]."""
        seconds: Array = 1e-9 * (self.stamps_ns - self.start_ns).astype(np.float64)
        return seconds

    @property
    def duration_s(self) -> float:
        """From the first stamp to the last [s]."""
        return float(self.seconds[-1] - self.seconds[0])


def camera_motion(logs: Sequence[CameraLog], first_ns: int | None = None) -> CameraMotion:
    """Bring the registrations of all cameras to common stamps.

    Args:
        logs: of all cameras.
        first_ns: stamp of the recording's time 0 [ns]; None for that of the first image, registered or not.

    Raises:
        RangeOfMotionError: a camera was never registered.
    """
    for log in logs:
        if not log.registered:
            raise RangeOfMotionError(
                f"camera {log.camera}: none of its {log.images} images could be registered in the map, so its segment "
                "is not measured; check that its lens is free and that it sees the mapped place"
            )
    registered = [[m for m in log.matches if m.world_T_camera is not None] for log in logs]
    own_stamps_ns = [np.array([m.stamp_ns for m in seen], dtype=np.int64) for seen in registered]
    together = find_shared_stamps({log.camera: own for log, own in zip(logs, own_stamps_ns, strict=True)}).cameras
    clock = max(range(len(logs)), key=lambda column: len(own_stamps_ns[column]))
    stamps_ns = own_stamps_ns[clock]
    shape = (len(stamps_ns), len(logs))
    world_T_camera = np.broadcast_to(np.eye(4), (*shape, 4, 4)).copy()
    frame_T_image = world_T_camera.copy()
    twists = np.zeros((*shape, 6))
    known = np.zeros(shape, dtype=bool)
    nearest: list[dict[str, LandmarkMatches]] = [{} for _ in stamps_ns]
    for column, (log, seen) in enumerate(zip(logs, registered, strict=True)):
        poses = np.stack([m.world_T_camera for m in seen if m.world_T_camera is not None])
        points = path_points(own_stamps_ns[column], poses, stamps_ns, _MAX_GAP_S)
        rows = points.rows
        world_T_camera[rows, column], twists[rows, column] = points.poses, points.twists
        known[rows, column] = True
        frame_T_image[rows, column] = inverse(points.poses) @ poses[points.nearest]
        for row, image in zip(rows, points.nearest, strict=True):
            nearest[row][log.camera] = seen[image]
    return CameraMotion(
        cameras=tuple(log.camera for log in logs),
        stamps_ns=stamps_ns,
        world_T_camera=world_T_camera,
        known=known,
        matches=tuple(nearest),
        frame_T_image=frame_T_image,
        twists=twists,
        triggered=np.array([log.camera in together for log in logs]),
        start_ns=min(log.matches[0].stamp_ns for log in logs) if first_ns is None else first_ns,
    )

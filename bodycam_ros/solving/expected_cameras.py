"""Where the body has the cameras that its registrations have lost: the way back from the solver to the registrar."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.geometry import adjoint, inverse
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.timing.clock_state import ClockState

_LOST_S = 0.1
"""Without a registration for so long; a blink is carried on by the registrar itself."""


@dataclass(frozen=True)
class ExpectedCamera:
    """A camera's pose as the body has it.

    Attributes:
        camera: its name.
        stamp_ns: when, by the camera's own clock [ns].
        world_T_camera: (4, 4).
        covariance: (6, 6) of it, rotation [rad] then translation [m], in the camera's axes.
    """

    camera: str
    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    covariance: NDArray[np.float64]


class ExpectedCameras:
    """Knows which cameras are lost, and says where the body has them.

    Args:
        body: that carries them.
    """

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        self._heard_ns: dict[str, int] = {}
        self._registered_ns: dict[str, int] = {}

    def hear(self, matches: LandmarkMatches) -> None:
        """What a camera says, in order of time, by its own clock."""
        camera, stamp_ns = matches.camera, matches.stamp_ns
        if stamp_ns <= self._heard_ns.get(camera, stamp_ns):
            self._registered_ns.pop(camera, None)  # its time begins anew
        self._heard_ns[camera] = stamp_ns
        if matches.world_T_camera is not None:
            self._registered_ns[camera] = stamp_ns

    @property
    def lost(self) -> list[str]:
        """Cameras that speak, and have not been registered for a while."""
        return [
            camera
            for camera, heard_ns in self._heard_ns.items()
            if camera in self._body.mounts
            and (camera not in self._registered_ns or heard_ns - self._registered_ns[camera] > 1e9 * _LOST_S)
        ]

    def of(self, state: BodyState, clocks: Mapping[str, ClockState]) -> list[ExpectedCamera]:
        """Where the lost cameras are at an instant, as far as their clocks are known."""
        return [
            expected_camera(
                camera,
                self._body.mounts[camera],
                state,
                state.stamp_ns + (clocks[camera].offset_ns(state.stamp_ns) if camera in clocks else 0),
            )
            for camera in self.lost
        ]


def expected_camera(camera: str, mount: CameraMount, state: BodyState, stamp_ns: int) -> ExpectedCamera:
    """The pose world_T_segment @ segment_T_camera of a camera, and its covariance.

    world_T_segment @ exp(xi) @ segment_T_camera = world_T_camera @ exp(Ad(camera_T_segment) @ xi).
    """
    row = state.segments.index(mount.segment)
    camera_xi_segment = adjoint(inverse(mount.segment_T_camera))
    return ExpectedCamera(
        camera,
        stamp_ns,
        state.world_T_segment[row] @ mount.segment_T_camera,
        camera_xi_segment @ state.uncertainty.segments[row] @ camera_xi_segment.T,
    )

"""Joints in the frame of a camera, by the registrations of its neighbours."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.quality.agreement import Agreement
from bodycam_ros.quality.contradiction import CameraLink, camera_links

_STEADY = 0.4
"""Spread of a place over time, as a share of how far it is off, below which it is off by the same all the time."""

_FIRM = 0.25
"""The same on both sides of a slip, where chance has a say in when it was."""

_LEAST_ROWS = 5
"""Instants on either side of a slip."""


@dataclass(frozen=True, eq=False)
class JointView:
    """The end of a link in a camera's frame, at the T instants at which the cameras on both sides are known.

    Attributes:
        expected: (3,) by the body [m].
        places: (T, 3) by the other camera [m].
        velocities: (T, 3) of that point in the world, in the camera's axes [m/s].
        seconds: (T,) [s].
    """

    expected: Array
    places: Array
    velocities: Array
    seconds: Array

    @property
    def offset(self) -> Array:
        """(3,) by how much it is off, usually [m]."""
        offset: Array = np.median(self.places, axis=0) - self.expected
        return offset

    @property
    def is_steady(self) -> bool:
        """Whether it is off by the same all the time."""
        return bool(_spread(self.places, np.median(self.places, axis=0)) < _STEADY * np.linalg.norm(self.offset))

    def slip(self, least_m: float) -> tuple[float, float] | None:
        """When it left where the body has it for another firm place [s], and how far that is [m], if it did."""
        rows = range(_LEAST_ROWS, len(self.places) - _LEAST_ROWS + 1)
        if not rows:
            return None
        row = min(rows, key=self._unexplained)
        before, after = self.places[:row], self.places[row:]
        home = np.median(after, axis=0)
        moved_m = float(np.linalg.norm(home - self.expected))
        if moved_m < least_m or max(_spread(before, self.expected), _spread(after, home)) > _FIRM * moved_m:
            return None
        return float(self.seconds[row]), moved_m

    def clock_error(self) -> tuple[float, float]:
        """By how much the camera's clock is ahead of the other's [s], and which share of the gaps that explains.

        With a clock that is ahead, an image with stamp t was taken before t: the joint lies ahead by its velocity times
        the clock's error. A body that is a little wrong leaves a constant in the camera's frame, which is subtracted.
        """
        gaps, velocities = self.places - self.places.mean(axis=0), self.velocities - self.velocities.mean(axis=0)
        moving, total = float((velocities**2).sum()), float((gaps**2).sum())
        if moving == 0.0 or total == 0.0:
            return 0.0, 0.0
        error_s = float((velocities * gaps).sum()) / moving
        return error_s, 1.0 - float(((gaps - error_s * velocities) ** 2).sum()) / total

    def gap_with_clock(self, error_s: float) -> float:
        """By how much it is still off, root mean square, if the camera's clock is ahead by so much [m]."""
        gaps = self.places - error_s * self.velocities - self.expected
        return float(np.sqrt((gaps**2).sum(axis=1).mean()))

    def _unexplained(self, row: int) -> float:
        """What two places, the body's until a row and another from it on, leave unexplained [m]."""
        after = self.places[row:]
        return float(
            np.linalg.norm(self.places[:row] - self.expected, axis=1).sum()
            + np.linalg.norm(after - np.median(after, axis=0), axis=1).sum()
        )


def joint_views(agreement: Agreement, body: BodyModel, core: Sequence[str], camera: str) -> list[JointView]:
    """A camera's nearest joints, or its own segment, by the core."""
    others = [name for name in core if name != camera]
    links = camera_links(body, body.mounts, [*others, camera])
    exact = [link for link in links if camera in (link.first, link.second) and link.is_exact]
    return [view for link in exact if len((view := joint_view(agreement, link, camera)).places) >= _LEAST_ROWS]


def joint_view(agreement: Agreement, link: CameraLink, camera: str) -> JointView:
    """The end of an exact link by its other camera."""
    other = link.second if camera == link.first else link.first
    pose, other_pose = agreement.registered(camera), agreement.registered(other)
    camera_R_world = np.swapaxes(pose[:, :3, :3], -1, -2)
    offset = link.place(other, other_pose) - link.place(camera, pose)
    places = link.end(camera) + (camera_R_world @ offset[:, :, None])[:, :, 0]
    # By the other camera: one whose places are wrong would move with its own errors.
    twist = agreement.twists[:, agreement.cameras.index(other)]
    moving = np.cross(twist[:, :3], link.end(other)) + twist[:, 3:]
    velocities = (camera_R_world @ other_pose[:, :3, :3] @ moving[:, :, None])[:, :, 0]
    known = np.isfinite(places).all(axis=1)
    return JointView(link.end(camera), places[known], velocities[known], agreement.seconds[known])


def _spread(places: Array, centre: Array) -> float:
    """Median distance from a place [m]."""
    return float(np.median(np.linalg.norm(places - centre, axis=1)))

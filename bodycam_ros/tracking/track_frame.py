"""The feature tracks of one image."""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

NO_LANDMARK: Final = 0xFFFFFFFF
"""In place of a landmark's id, of a track without one."""

DESCRIPTOR_LENGTH: Final = 128


@dataclass(frozen=True, kw_only=True)
class TrackFrame:
    """The feature tracks of one camera in one image.

    A track keeps its id from first to last image. Only a track that needs a landmark carries a descriptor, and only
    in the image in which it was described.

    Attributes:
        camera: the camera's name, which is its topic prefix.
        stamp_ns: mid-exposure of the middle row [ns].
        previous_stamp_ns: stamp of the frame that ``current_R_previous`` starts from; 0 if there is none.
        track_ids: (N,) uint32.
        pixels: (N, 2) float32, pixel centres at integers.
        described: (M,) uint32, rows of ``track_ids`` that carry a descriptor in this frame, the strongest first.
        descriptors: (M, 128) uint8 RootSIFT.
        scales: (M,) float32, SIFT scale (sigma) of the described tracks [px].
        keyframe: whether new features were detected in this frame.
        current_R_previous: (3, 3) rotation of the camera between the two frames (A eq. 2).
        rotation_inliers: tracks that agree with that rotation; 0 if it is unknown.
        landmark_ids: (N,) uint32 the landmarks that the tracks were found by; ``NO_LANDMARK`` of the others. None: of
            no track.
        world_T_camera: (4, 4) pose fitted to the tracks, if all of them were found by their landmarks; else None.
        pose_information: (6, 6) of that pose, rotation [1/rad^2] then translation [1/m^2] in camera axes.
        shifts: (N, 2) how far the read-out of the rows moved the tracks in the image [px], by that pose.
        map_identity: text of the ``MapIdentity`` of the landmarks and the pose; empty if it is not known.
    """

    camera: str
    stamp_ns: int
    previous_stamp_ns: int
    track_ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]
    described: NDArray[np.uint32] = field(default_factory=lambda: np.zeros(0, np.uint32))
    descriptors: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, DESCRIPTOR_LENGTH), np.uint8))
    scales: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    keyframe: bool = False
    current_R_previous: NDArray[np.float64]
    rotation_inliers: int
    landmark_ids: NDArray[np.uint32] | None = None
    landmark_rows: NDArray[np.int64] | None = None
    world_T_camera: NDArray[np.float64] | None = None
    pose_information: NDArray[np.float64] | None = None
    shifts: NDArray[np.float64] | None = None
    map_identity: str = ""

    @property
    def measured_rotation(self) -> NDArray[np.float64] | None:
        """(3, 3) ``current_R_previous``, or None if it is unknown."""
        return self.current_R_previous if self.rotation_inliers else None


def find_rows(
    ids: NDArray[np.uint32], wanted: NDArray[np.uint32], order: NDArray[np.int64] | None = None
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Rows (N,) of wanted ids, and whether each is there; rows of absent ones are meaningless.

    Args:
        ids: (M,) ascending, at least in ``order``.
        wanted: (N,).
        order: (M,) rows that sort the ids.
    """
    if not len(ids):
        return np.zeros(len(wanted), np.int64), np.zeros(len(wanted), bool)
    rows = np.minimum(np.searchsorted(ids, wanted, sorter=order), len(ids) - 1)
    rows = rows if order is None else order[rows]
    return rows, ids[rows] == wanted

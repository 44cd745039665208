"""PLY: a point cloud of the registered landmarks, grey, and of the segments' trajectories, each in its own colour.

SLAM systems write it; MeshLab, CloudCompare, Open3D and Blender read it. Metres; z is up. A landmark has its last
position. In a gap a trajectory has no points.
"""

from colorsys import hsv_to_rgb
from pathlib import Path

import numpy as np

from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion
from bodycam_ros.geometry import Array
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.topics import LANDMARKS, LANDMARKS_TYPE, read_landmarks

MARK = "comment bodycam: "

_GREY = (150, 150, 150)
_POINT = np.dtype([(axis, "<f4") for axis in "xyz"] + [(colour, "u1") for colour in ("red", "green", "blue")])
_TYPES = {"<f4": "float", "|u1": "uchar"}


def write_ply(motion: SampledMotion, options: MotionOptions) -> bytes:
    """The motion and the landmarks of its bag as a point cloud.

    Raises:
        RecordingError: the bag is damaged.
    """
    landmarks = _landmarks(motion.path)
    clouds = [_coloured(landmarks, _GREY)]
    comments = [f"{MARK}{len(landmarks)} landmarks, then the trajectories of segments"]
    for row, segment in enumerate(motion.body.segments):
        known = motion.segment_poses(segment)[motion.known_frames(segment), :3, 3]
        red, green, blue = (round(255 * part) for part in hsv_to_rgb(row / len(motion.body.segments), 0.9, 0.9))
        clouds.append(_coloured(known, (red, green, blue)))
        comments.append(f"comment {len(known)} points of {'_'.join(segment.split())}")
    points = np.concatenate(clouds)
    properties = [f"property {_TYPES[_POINT[name].str]} {name}" for name in _POINT.names or ()]
    comments += [f"element vertex {len(points)}", *properties, "end_header"]
    header = "\n".join(["ply", "format binary_little_endian 1.0", *comments])
    return header.encode() + b"\n" + points.tobytes()


def _landmarks(source: Path) -> Array:
    """(N, 3) of all cameras, each once [m]; none of a bag without registrations, as of static cameras alone."""
    with BagFile(source) as bag:
        cameras = bag.camera_topics(LANDMARKS, LANDMARKS_TYPE).values()
    positions: dict[int, tuple[float, ...]] = {}
    for matches in read_landmarks(source, cameras):
        positions.update(zip(matches.landmark_ids.tolist(), map(tuple, matches.points_world.tolist()), strict=True))
    return np.array(list(positions.values()), dtype=np.float64).reshape(-1, 3)


def _coloured(positions: Array, colour: tuple[int, int, int]) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    points = np.zeros(len(positions), _POINT)
    for column, axis in enumerate("xyz"):
        points[axis] = positions[:, column]
    for name, part in zip(("red", "green", "blue"), colour, strict=True):
        points[name] = part
    return points

"""PLY: a cloud of the landmarks that cameras found, grey, and the ways that segments went, each in a colour of its own.

What SLAM systems write and MeshLab, CloudCompare, Open3D and Blender read. Metres; z is up. A landmark is where it was
seen last. In a gap a way has no points.
"""

from colorsys import hsv_to_rgb
from pathlib import Path

import numpy as np

from bodycam_ros.formats.options import MotionOptions
from bodycam_ros.formats.sampled_motion import sampled
from bodycam_ros.geometry import Array
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.solved_body import read_solved_body
from bodycam_ros.results.topics import LANDMARKS, LANDMARKS_TYPE, camera_topics, read_landmarks

MARK = "comment bodycam: "

_GREY = (150, 150, 150)
_POINT = np.dtype([(axis, "<f4") for axis in "xyz"] + [(colour, "u1") for colour in ("red", "green", "blue")])
_TYPES = {"<f4": "float", "|u1": "uchar"}


def ply(source: Path, options: MotionOptions, progress: Progress) -> dict[str, bytes]:
    """What is in a solved bag as a cloud of points.

    Raises:
        RecordingError: the bag cannot be read, or nobody solved it.
    """
    motion = sampled(read_solved_body(source, progress), options.rate, even=False)
    landmarks = _landmarks(source, progress)
    clouds = [_coloured(landmarks, _GREY)]
    says = [f"{MARK}{len(landmarks)} landmarks, then the ways of segments"]
    for row, segment in enumerate(motion.body.segments):
        known = motion.poses_of(segment)[motion.knows(segment), :3, 3]
        red, green, blue = (round(255 * part) for part in hsv_to_rgb(row / len(motion.body.segments), 0.9, 0.9))
        clouds.append(_coloured(known, (red, green, blue)))
        says.append(f"comment {len(known)} points of {'_'.join(segment.split())}")
    points = np.concatenate(clouds)
    properties = [f"property {_TYPES[_POINT[name].str]} {name}" for name in _POINT.names or ()]
    says += [f"element vertex {len(points)}", *properties, "end_header"]
    header = "\n".join(["ply", "format binary_little_endian 1.0", *says])
    return {"": header.encode() + b"\n" + points.tobytes()}


def _landmarks(source: Path, progress: Progress) -> Array:
    """(N, 3) of all cameras, each once [m]; none of a bag without registrations, as of static cameras alone."""
    with BagFile(source) as bag:
        cameras = camera_topics(bag, LANDMARKS, LANDMARKS_TYPE)
        images = sum(map(bag.message_count, cameras))
    places: dict[int, tuple[float, ...]] = {}
    with progress.step(f"landmarks of {source.name}", images) as advance:
        for matches in read_landmarks(source, cameras.values()):
            advance()
            places.update(zip(matches.landmark_ids.tolist(), map(tuple, matches.points_world.tolist()), strict=True))
    return np.array(list(places.values()), dtype=np.float64).reshape(-1, 3)


def _coloured(places: Array, colour: tuple[int, int, int]) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    points = np.zeros(len(places), _POINT)
    for column, axis in enumerate("xyz"):
        points[axis] = places[:, column]
    for name, part in zip(("red", "green", "blue"), colour, strict=True):
        points[name] = part
    return points

"""A real person before four static cameras (Pose2Sim's demo), against the joints of its authors' own pipeline."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from benchmarks.figures.bench import Bench, verdict
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import Array, Result, rigid_fit
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.viewer.placing import PlacingSources

_RATE_HZ = 60
_CUT_ABOVE_PX = 7
"""Two of the videos lack some rows and columns that their lens counts."""

JOINTS = {
    f"{segment}_{side}": [name.format(long=side[0].upper(), short="L" if side == "left" else "r") for name in names]
    for side in ("left", "right")
    for segment, names in {
        "thigh": ["{long}HJC_study"],
        "shin": ["{short}_knee_study", "{short}_mknee_study"],
        "foot": ["{short}_ankle_study", "{short}_mankle_study"],
        "upper_arm": ["{long}Shoulder"],
        "forearm": ["{short}_lelbow_study", "{short}_melbow_study"],
        "hand": ["{short}_lwrist_study", "{short}_mwrist_study"],
    }.items()
}
"""Segment -> markers whose mean is its origin."""


_BY_HAND = {
    "pelvis": (-1.42, 0.02, 0.86),
    "head": (-1.43, -0.04, 1.42),
    "foot_left": (-1.15, -0.01, 0.13),
    "foot_right": (-1.60, 0.04, 0.12),
    "hand_left": (-1.43, 0.35, 0.95),
    "hand_right": (-1.33, -0.37, 0.90),
    "shin_left": (-1.23, 0.05, 0.54),
    "shin_right": (-1.42, -0.05, 0.49),
    "forearm_left": (-1.47, 0.28, 1.17),
    "forearm_right": (-1.50, -0.32, 1.11),
}
"""Segment -> where its origin was moved to, by eye in the four images [m]; the pelvis faces along x."""


def pose2sim(bench: Bench) -> Iterator[Figure]:
    """Good starts, by markers and by hand; without arms or all limbs, and a camera 25 cm off: must not pass as good."""
    assert bench.shared is not None
    demo = bench.shared / "real/pose2sim_single"
    bag = write_bag(demo, bench.work / "pose2sim.bag")
    by_hand = place_by_hand(demo, bag, bench.work / "pose2sim_by_hand.yaml")
    for what, cameras, start in (
        ("", "cameras", demo / "start.yaml"),
        (", placed by hand", "cameras", by_hand),
        (", no arms in the start", "cameras", demo / "start_noarms.yaml"),
        (", pelvis alone in the start", "cameras", demo / "start_pelvis.yaml"),
        (", cam03 24 cm off", "cameras_cam03_moved", demo / "start.yaml"),
    ):
        group = f"pose2sim{what}"
        flags = ("--stations", demo / f"{cameras}.yaml", "--start", start)
        ran = bench.replay(group, bag, demo / "body.yaml", *flags)
        off_cm = against_markers(Result.read(bench.out(group)), demo / "reference.trc")
        yield Figure(f"{group}: joint position, aligned, mean [cm]", float(np.nanmean(off_cm)))
        yield Figure(f"{group}: joint position, aligned, max [cm]", float(np.nanmax(off_cm)))
        yield Figure(f"{group}: verdict", verdict(ran))


def place_by_hand(demo: Path, bag: Path, start: Path) -> Path:
    """A start as a person makes it with 'bodycam view --place': segments moved one after the other, then fitted."""
    files = StaticCameraFiles(demo / "cameras.yaml")
    sources = PlacingSources(bag, files, demo / "body.yaml", None)
    placement = sources.placement.moved_to("pelvis", np.eye(4))
    for segment, place in _BY_HAND.items():
        pose = placement.pose_of(segment).copy()
        pose[:3, 3] = place
        placement = placement.moved_to(segment, pose)
    sources.write(start, sources.fit(placement.poses)[0])
    return start


def write_bag(demo: Path, bag: Path) -> Path:
    """The videos as a bag of JPEGs, at the size that their lenses are for."""
    types = get_typestore(Stores.ROS2_JAZZY)
    image_type, info_type = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"
    Image, Info = types.types[image_type], types.types[info_type]
    with Writer(bag, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer:
        videos, topics = {}, {}
        for path in sorted((demo / "videos").glob("*.mp4")):
            lens = yaml.safe_load((demo / f"{path.stem}.yaml").read_text())
            videos[path.stem] = cv2.VideoCapture(str(path)), lens
            topics[path.stem] = (
                writer.add_connection(f"/{path.stem}/image_raw/compressed", image_type, typestore=types),
                writer.add_connection(f"/{path.stem}/camera_info", info_type, typestore=types),
            )
        number = 0
        while frames := {name: frame for name, (video, _) in videos.items() for ok, frame in [video.read()] if ok}:
            stamp_ns = 1_700_000_000 * 10**9 + round(number * 1e9 / _RATE_HZ)
            for name, frame in frames.items():
                lens = videos[name][1]
                width, height = lens["image_width"], lens["image_height"]
                whole = np.zeros((height, width, 3), np.uint8)
                rows, columns = min(frame.shape[0], height), min(frame.shape[1], width)
                above = _CUT_ABOVE_PX if frame.shape[0] < height else 0
                whole[above : above + rows, :columns] = frame[:rows, :columns]
                header = _header(types, stamp_ns, name)
                data = cv2.imencode(".jpg", whole)[1].ravel()
                message = Image(header=header, format="bgr8; jpeg compressed bgr8", data=data)
                writer.write(topics[name][0], stamp_ns, types.serialize_cdr(message, image_type))
                if number == 0:
                    info = _camera_info(types, Info, header, lens)
                    writer.write(topics[name][1], stamp_ns, types.serialize_cdr(info, info_type))
            number += 1
    return bag


def _header(types: Any, stamp_ns: int, frame: str) -> Any:
    Header = types.types["std_msgs/msg/Header"]
    Time = types.types["builtin_interfaces/msg/Time"]
    return Header(stamp=Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9), frame_id=frame)


def _camera_info(types: Any, Info: type, header: Any, lens: Mapping[str, Any]) -> object:
    roi = types.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    K = np.array(lens["camera_matrix"]["data"], float)
    P = np.hstack([K.reshape(3, 3), np.zeros((3, 1))]).ravel()
    return Info(
        header, lens["image_height"], lens["image_width"], lens["distortion_model"],
        np.array(lens["distortion_coefficients"]["data"], float), K, np.eye(3).ravel(), P, 0, 0, roi,
    )  # fmt: skip


def against_markers(result: Result, trc: Path) -> Array:
    """(T, J) distances [cm] of joints from the means of markers, after one rigid alignment."""
    lines = trc.read_text().splitlines()
    names = [name for name in lines[3].split("\t")[2:] if name]
    rows = [[float(x) if x else np.nan for x in line.split("\t")[: 2 + 3 * len(names)]] for line in lines[5:] if line]
    # The file's y axis is up; the cameras' file has z up.
    markers = np.array(rows)[:, 2:].reshape(len(rows), -1, 3)[:, :, [2, 0, 1]]
    frames = np.round((result.seconds - result.seconds[0]) * _RATE_HZ).astype(int)
    known = frames < len(markers)
    joints = [joint for joint in JOINTS if joint in result.links]
    ours = np.stack([result.links[joint][known, :3, 3] for joint in joints], axis=1)
    theirs = np.stack(
        [np.mean([markers[frames[known], names.index(m)] for m in JOINTS[joint]], axis=0) for joint in joints], axis=1
    )
    both = np.isfinite(theirs).all(axis=2)
    R, t = rigid_fit(ours[both], theirs[both])
    return np.asarray(100.0 * np.linalg.norm(ours @ R.T + t - theirs, axis=2))

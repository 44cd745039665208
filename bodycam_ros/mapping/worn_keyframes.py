"""Sharp frames of all worn cameras of a recording, well spread over how each has moved: the photographs of a map."""

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError, RecordingError
from bodycam_ros.mapping.frame_choice import FrameChoiceSettings, choose_frames
from bodycam_ros.mapping.frame_motion import FrameMotion, frame_motion
from bodycam_ros.mapping.photographs import Photographs
from bodycam_ros.mapping.progress import Progress, in_parallel
from bodycam_ros.settings import setting

if TYPE_CHECKING:
    from bodycam_ros.mapping.carried_camera import BagCamera

_LOG = logging.getLogger(__name__)

_CUT_DEG = 12.0  # by which the view of a limb has changed where flow has lost all points
_NO_LIMIT_DEG = 360.0  # frames of a limb that swings may be far apart: those of other cameras lie between them


@dataclass(frozen=True)
class WornKeyframeSettings:
    """Which frames of the worn cameras become photographs of a map."""

    most: int = setting(
        150, unit="frames", limits=(10, 2000), reason="of all cameras together; time grows faster than their number"
    )
    fewest: int = setting(8, unit="frames", limits=(2, 200), reason="of each camera, also of one that has hardly moved")
    min_step_deg: float = setting(
        4.0,
        unit="deg",
        limits=(0.1, 60.0),
        reason="frames of a camera that are closer show the same from the same place",
    )
    min_sharpness: float = setting(
        0.7,
        limits=(0.0, 1.0),
        reason="least contrast of fine detail against the frames half a second around; limbs that swing blur",
    )


@dataclass(frozen=True)
class Moment:
    """Which camera took a keyframe, and when by the stamps of the recording [s]."""

    camera: str
    seconds: float


@dataclass(frozen=True)
class WornPhotographs(Photographs):
    """Keyframes of worn cameras in a folder.

    Attributes:
        moments: file name -> when it was taken.
    """

    moments: Mapping[str, Moment]


def keep_worn_keyframes(
    bag: Path,
    cameras: Collection[str] | None,
    at_once: Sequence[tuple[str, str]],
    folder: Path,
    board_path: Path | None,
    settings: WornKeyframeSettings,
    workers: int,
    progress: Progress,
) -> WornPhotographs:
    """Write the keyframes of a recording into a folder.

    Args:
        bag: ros2 bag folder or .mcap file.
        cameras: those that are worn; None: all that there are.
        at_once: pairs of cameras of which keyframes of the same instants are wanted.
        folder: to be.
        board_path: description of the board that they may show.
        settings: how many.
        workers: threads.
        progress: shows the steps.

    Raises:
        MapError: a camera that is asked for is not there, or nothing moves.
        RecordingError: the recording cannot be read.
        LensError: a camera's intrinsics are malformed.
    """
    # Nodes load all settings, these among them, and no reader of bags.
    from bodycam_ros.mapping.carried_camera import BagCamera
    from bodycam_ros.recording.bag_reader import open_recording

    with open_recording(bag) as recording:
        there = recording.cameras
    names = [camera for camera in there if cameras is None or camera in cameras]
    asked = set(cameras or ()) | {camera for pair in at_once for camera in pair}
    if absent := sorted(asked - set(there)):
        raise MapError(f"{bag}: has no camera {', '.join(absent)}; there are {', '.join(there)}")
    sources = [BagCamera(bag, camera, None) for camera in names]
    with progress.step("looking at frames", sum(source.count for source in sources)) as advance:
        motions = dict(
            zip(
                names,
                in_parallel(lambda source: frame_motion(source, _CUT_DEG, advance), sources, workers),
                strict=True,
            )
        )
    rows = _chosen(motions, settings)
    for first, second in at_once:
        rows[second] = np.union1d(rows[second], _nearest(motions[first].seconds[rows[first]], motions[second].seconds))
    folder.mkdir()
    camera_of_name: dict[str, CameraModel] = {}
    moments: dict[str, Moment] = {}
    with progress.step("keeping keyframes", sum(map(len, rows.values()))) as advance:
        for camera, source in zip(names, sources, strict=True):
            for name, seconds in _written(source, camera, rows[camera], folder):
                camera_of_name[name], moments[name] = source.camera, Moment(camera, seconds)
                advance()
    paths = tuple(folder / name for name in sorted(camera_of_name))
    _LOG.info("%s: %d keyframes of %d cameras", bag, len(paths), len(names))
    return WornPhotographs(folder, bag.resolve().name, paths, camera_of_name, board_path, moments)


def _chosen(motions: Mapping[str, FrameMotion], settings: WornKeyframeSettings) -> dict[str, NDArray[np.int64]]:
    """Rows of the frames of each camera: one for each step of how far all of them have moved together."""
    path_deg = sum(float(motion.path_deg[-1] - motion.path_deg[0]) for motion in motions.values())
    choice = FrameChoiceSettings(
        step_deg=max(path_deg / settings.most, settings.min_step_deg),
        fewest=settings.fewest,
        most=settings.most,
        min_step_deg=settings.min_step_deg,
        max_step_deg=_NO_LIMIT_DEG,
        min_sharpness=settings.min_sharpness,
    )
    rows = {}
    for camera, motion in motions.items():
        try:
            rows[camera] = choose_frames(motion, camera, choice)
        except MapError:  # it has hardly moved
            rows[camera] = np.argmax(motion.sharpness, keepdims=True).astype(np.int64)
    if sum(map(len, rows.values())) < 2:
        raise MapError("the recording shows no motion; record a range of motion, in which every limb moves")
    return rows


def _nearest(seconds: NDArray[np.float64], among: NDArray[np.float64]) -> NDArray[np.int64]:
    """Rows (N,) of the times that are nearest to those asked for (N,)."""
    nearest: NDArray[np.int64] = np.abs(among[None] - seconds[:, None]).argmin(axis=1)
    return nearest


def _written(source: "BagCamera", camera: str, rows: NDArray[np.int64], folder: Path) -> list[tuple[str, float]]:
    """Write frames of a camera; their names and times [s]."""
    wanted, written = set(rows.tolist()), []
    with source.frames() as frames:
        for row, frame in enumerate(frames):
            if row in wanted:
                suffix, content = frame.file()
                name = f"{camera.replace('/', '_')}_{row:06d}{suffix}"
                (folder / name).write_bytes(content)
                written.append((name, frame.seconds))
                if len(written) == len(wanted):
                    return written
    raise RecordingError(f"{source.name}: ends at another frame when it is read again; is it being written?")

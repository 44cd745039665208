"""CPU time of static cameras for one state of the body: python -m benchmarks.static_camera_timing BODY.yaml.

Four cameras see a person of capsules in plain colours before noise, who moves as far between images as people who walk.
The scene is rendered here: the time depends on the number of correspondence lines, not on what they show.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import camera_from_info
from bodycam_ros.estimation.motion_model import predict
from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.static_cameras.articulated_step import PredictedBody
from bodycam_ros.static_cameras.contour_kernels import NOBODY
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.station import RegionModel, Station
from bodycam_ros.static_cameras.surface import BodySurface

STATIONS = 4
_WIDTH, _HEIGHT, _FOCAL_PX = 640, 480, 525.0
_AWAY_M = 4.0  # of the stations, all around
_STEP_M, _TURN_RAD, _DT_S = 0.03, 0.03, 1.0 / 30.0  # of the person, from image to image
_FIRST_SLOW = 2  # instants that are not timed
_SIGMAS = np.repeat([0.08, 0.03], 3)  # of where the person is expected

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class StationTiming:
    """Milliseconds of CPU for a state of the body, all images decoded.

    Attributes:
        look_ms: for each state.
        segments, faces: of the person.
        stations: number of cameras.
        largest_off_m: largest error of a segment's position [m]; it shows whether the person was tracked.
    """

    look_ms: list[float]
    segments: int
    faces: int
    stations: int
    largest_off_m: float

    @property
    def median_ms(self) -> float:
        """Median of a state."""
        return float(np.median(self.look_ms))

    @property
    def share_ms(self) -> float:
        """Median of a state, per segment and camera."""
        return self.median_ms / (self.segments * self.stations)


def time_stations(body: BodyModel, settings: PipelineSettings, instants: int = 20) -> StationTiming | None:
    """Track a body through rendered images, on one thread; None if it has no bones to put capsules on."""
    surfaces = capsule_surfaces(body)
    if not surfaces:
        return None
    surface = BodySurface.of(body, surfaces)
    tracker = RegionTracker(body, surface, _stations(), settings.region)
    motion = [_poses(body, number) for number in range(_FIRST_SLOW + instants)]
    before, poses, spent, off = motion[0], motion[0], [], 0.0
    random = np.random.default_rng(0)
    for number, truth in enumerate(motion):
        images = {name: _painted(view, truth, len(body.segments), random) for name, view in tracker.views.items()}
        if number == 0:
            tracker.update_colours(images, truth)
        expected = PredictedBody(predict(before, poses, _DT_S, _DT_S), _SIGMAS, float(_SIGMAS[0]))
        started = time.process_time()
        before, poses = poses, tracker.measure(images, expected).world_T_segment
        spent.append(1e3 * (time.process_time() - started))
        off = max(off, float(np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1).max()))
    faces = len(surface.faces)
    return StationTiming(spent[_FIRST_SLOW:], len(body.segments), faces, STATIONS, off)


def _stations() -> dict[str, Station]:
    K = [_FOCAL_PX, 0.0, 0.5 * _WIDTH, 0.0, _FOCAL_PX, 0.5 * _HEIGHT, 0.0, 0.0, 1.0]
    stations = {}
    for number in range(STATIONS):
        name, angle = f"station {number}", 2.0 * np.pi * (number + 0.3) / STATIONS
        inward = -np.array([np.cos(angle), np.sin(angle), 0.0])
        down = np.array([0.0, 0.0, -1.0])
        world_R_camera = np.column_stack([np.cross(down, inward), down, inward])
        camera = camera_from_info(name, _WIDTH, _HEIGHT, "plumb_bob", [0.0] * 5, K)
        stations[name] = Station(name, rigid(world_R_camera, -_AWAY_M * inward), camera)
    return stations


def _poses(body: BodyModel, number: int) -> Array:
    """(S, 4, 4) the body in its N-pose, going about."""
    root = rigid(exp_so3(np.array([0.0, 0.0, _TURN_RAD * number])), np.array([_STEP_M * (number - 10), 0.0, 0.0]))
    return body.forward_kinematics(root, np.tile(np.eye(3), (len(body.tree_joints), 1, 1)))


def _painted(view: RegionModel, world_T_segment: Array, segments: int, random: np.random.Generator) -> Image:
    """The body in a station's image: each segment in its own colour, before noise."""
    labels = view.contour(world_T_segment).labels
    large = cv2.resize(labels, (_WIDTH, _HEIGHT), interpolation=cv2.INTER_NEAREST)
    noise = random.integers(0, 256, (_HEIGHT, _WIDTH, 3))
    colours = np.random.default_rng(1).integers(20, 236, (segments, 3))
    person = colours[np.minimum(large, segments - 1)] + noise // 16 - 8
    return np.where((large == NOBODY)[..., None], noise, person).astype(np.uint8)


def main() -> None:
    """Print the time of a state."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("body", type=Path)
    timing = time_stations(read_body(parser.parse_args().body), PipelineSettings())
    if timing is None:
        parser.error("the body has no bones to put capsules on")
    print(
        f"{timing.median_ms:.1f} ms a state of {timing.stations} cameras, {timing.segments} segments and "
        f"{timing.faces:,} faces; {timing.share_ms:.2f} ms per segment and camera; largest error "
        f"{100.0 * timing.largest_off_m:.1f} cm"
    )


if __name__ == "__main__":
    main()

"""Worn and static cameras live: stations that look by themselves say what a replay sees, which has all images at once.

The leg without cameras is seen by one station at a time, as where images are left out: what a station takes for the
leg's velocity then is all that holds it.
"""

import numpy as np
import pytest
from moving_body import COVARIANCE, lenses
from numpy.typing import NDArray
from outside.dressed_body import DressedBody, small_motion, stations_around

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.camera.raw_picture import RawPicture
from bodycam_ros.geometry import exp_se3
from bodycam_ros.outside.body_surface import BodySurface
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.lone_station import LoneStation
from bodycam_ros.outside.region_tracker import RegionTracker
from bodycam_ros.outside.station_reports import StationReports
from bodycam_ros.outside.station_watch import StationWatch
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.body_smoother import BodySmoother
from bodycam_ros.solving.body_state import BodyState

Array = NDArray[np.float64]

FRAMES, STEP_NS, START_NS = 16, 33_333_333, 1_000_000_000
SETTINGS = PipelineSettings()
UNSEEN = ("thigh_left", "shin_left", "foot_left")


@pytest.fixture(scope="module")
def dressed(sample) -> DressedBody:
    body = read_body(sample / "body.yaml")
    return DressedBody(body, capsule_surfaces(body), dict(list(stations_around(3).items())[:2]))


@pytest.fixture(scope="module")
def motion(dressed: DressedBody) -> Array:
    """Three times as quick as a walk through the same poses."""
    return small_motion(dressed.body, 3 * FRAMES)[::3]


@pytest.fixture(scope="module")
def images(dressed: DressedBody, motion: Array) -> list[dict[str, CameraImage]]:
    """The first images of both stations, then they take turns."""
    taken = []
    for frame, poses in enumerate(motion):
        pictures = dressed.images(poses, 1.0, frame)
        looking = [name for place, name in enumerate(pictures) if frame < 4 or frame % 2 == place]
        stamp_ns = START_NS + frame * STEP_NS
        taken.append({name: CameraImage(name, stamp_ns, RawPicture("bgr8", pictures[name])) for name in looking})
    return taken


def worn(body: BodyModel, motion: Array, frame: int, random: np.random.Generator) -> dict[str, LandmarkMatches]:
    """What the cameras say that one leg has not."""
    said = {}
    for camera, mount in body.mounts.items():
        if mount.segment in UNSEEN:
            continue
        now, before = motion[[frame, max(0, frame - 1)], body.segment_index[mount.segment]] @ mount.segment_T_camera
        said[camera] = LandmarkMatches(
            camera=camera, stamp_ns=START_NS + frame * STEP_NS, previous_stamp_ns=START_NS + (frame - 1) * STEP_NS,
            track_ids=np.zeros(0, np.uint32), landmark_ids=np.zeros(0, np.uint32), pixels=np.zeros((0, 2), np.float32),
            points_world=np.zeros((0, 3), np.float32), pose_covariance=COVARIANCE, rotation_inliers=50,
            world_T_camera=now @ exp_se3(np.sqrt(np.diag(COVARIANCE)) * random.standard_normal(6)),
            current_R_previous=now[:3, :3].T @ before[:3, :3],
        )  # fmt: skip
    return said


def tracker_of(dressed: DressedBody, *stations: str) -> RegionTracker:
    surface = BodySurface.of(dressed.body, dressed.surfaces)
    seen_through = {name: dressed.stations[name] for name in stations}
    return RegionTracker(dressed.body, surface, seen_through, SETTINGS.region)


def replayed(dressed: DressedBody, motion: Array, images: list[dict[str, CameraImage]]) -> list[BodyState]:
    body, random = dressed.body, np.random.default_rng(0)
    watch = StationWatch(tracker_of(dressed, *dressed.stations), None, SETTINGS.region, SETTINGS.motion)
    smoother = BodySmoother(body, lenses(body), onlookers=watch)
    states = []
    for frame, seen in enumerate(images):
        matches = worn(body, motion, frame, random)
        states += smoother.update(BodyFrame(START_NS + frame * STEP_NS, matches, seen))
    return states + smoother.flush()


def live(dressed: DressedBody, motion: Array, images: list[dict[str, CameraImage]]) -> list[BodyState]:
    body, random = dressed.body, np.random.default_rng(0)
    of = SETTINGS.region, SETTINGS.motion
    alone = {name: LoneStation(name, tracker_of(dressed, name), None, *of) for name in dressed.stations}
    smoother = BodySmoother(body, lenses(body), onlookers=StationReports(body, None, *of))
    states = []
    for frame, seen in enumerate(images):
        stamp_ns, matches = START_NS + frame * STEP_NS, worn(body, motion, frame, random)
        said = {name: alone[name].look(image) for name, image in seen.items() if alone[name].knows(stamp_ns)}
        heard = {name: words for name, words in said.items() if words is not None}
        states += smoother.update(BodyFrame(stamp_ns, matches, {}, heard))
        for body_then in smoother.lately:
            for station in alone.values():
                station.hear(body_then)
    return states + smoother.flush()


def test_a_leg_without_cameras_is_followed_live_as_in_a_replay(
    dressed: DressedBody, motion: Array, images: list[dict[str, CameraImage]]
) -> None:
    rows = [dressed.body.segment_index[segment] for segment in UNSEEN]
    poses, off = {}, {}
    for kind, solve in (("replay", replayed), ("live", live)):
        poses[kind] = np.array([state.world_T_segment for state in solve(dressed, motion, images)])
        assert len(poses[kind]) == FRAMES
        off[kind] = np.linalg.norm((poses[kind] - motion)[..., :3, 3], axis=2)
        print(kind, np.round(100 * off[kind][:, rows[1:]].max(axis=1), 1), f"mean {100 * off[kind].mean():.2f} cm")
    # Live it is looked for in the third image: only then the body and its motion are known.
    assert off["replay"][3:, rows].mean() < 0.02
    assert off["live"][3:, rows].mean() < 0.02
    apart = np.linalg.norm((poses["live"] - poses["replay"])[3:, rows, :3, 3], axis=2)
    assert apart.mean() < 0.01

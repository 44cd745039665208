"""A painted person whose lengths and girths are known, measured from a body that is five per cent off."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from static_cameras.dressed_body import DressedBody, small_motion, static_cameras_around
from threadpoolctl import threadpool_limits

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_shape import BodyShape, ShapeSettings
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras import body_measurement, region_fit, region_tracker, shape_evidence
from bodycam_ros.static_cameras.body_measurement import BodyMeasurement, MeasuredBody
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.start_file import PlacedBody, start_poses

pytestmark = pytest.mark.long

INSTANTS = 9
STATIONS = 4
STEP_NS = 100_000_000
OFF, THICK = 0.05, 0.06

# Painted people are capsules, and no two of their lines err together.
SETTINGS = ShapeSettings(length_sigma=0.1)
REGION = RegionSettings()

BENT = {"knee", "ankle", "elbow", "shoulder"}
"""Joints that move, in view of all stations."""


@dataclass(frozen=True, eq=False)
class Painted:
    """A person, the initial body, and the instants."""

    person: BodyModel
    initial: BodyModel
    first: Array
    dressed: DressedBody
    instants: list[BodyFrame]

    def read(self) -> Iterator[tuple[float, BodyFrame]]:
        yield from ((number / len(self.instants), instant) for number, instant in enumerate(self.instants))

    def placed(self, body: BodyModel) -> PlacedBody:
        poses = start_poses(body, dict(zip(body.segments, self.first, strict=True)))
        return PlacedBody(poses, np.zeros(len(poses), bool))

    def measure(self, settings: ShapeSettings, instants: int = INSTANTS) -> MeasuredBody:
        with threadpool_limits(limits=1), pytest.MonkeyPatch.context() as patch:
            for module in (region_fit, region_tracker, shape_evidence):
                patch.setattr(module, "LINES_ALIKE", 1.0)
            for name, value in {"_SURFACE_SIGMA_M": 0.002, "_ALIKE_S": 1e-9 * STEP_NS, "_ROUNDS": 3}.items():
                patch.setattr(body_measurement, name, value)
            return BodyMeasurement(
                self.initial,
                self.dressed.stations,
                lambda: list(self.read())[:instants],
                self.placed,
                settings,
                REGION,
                MotionSettings(),
            ).measure()


@pytest.fixture(scope="module")
def painted(sample: Path) -> Painted:
    known = replace(read_body(sample / "body.yaml"), mounts={}, report={})
    girths = {name: 1.0 + THICK * (-1) ** number for number, name in enumerate(_kinds(known))}
    person = replace(known, girths={segment: girths[SegmentName(segment).kind] for segment in known.segments})
    shape = BodyShape(person, SETTINGS)
    signs = np.random.default_rng(5).choice([-1.0, 1.0], 20)
    sides = [SegmentName(joint.name).kind + str(axis) for joint, axis in shape.lengths]
    shares = np.zeros(shape.size)
    shares[: len(sides)] = [OFF * signs[sorted(set(sides)).index(side)] for side in sides]
    begun = replace(shape.shaped(shares), girths={})
    dressed = DressedBody(person, capsule_surfaces(person), static_cameras_around(STATIONS))
    motion = small_motion(person, 2 * INSTANTS, 0.35)[::2]
    instants = [
        BodyFrame(
            number * STEP_NS,
            {},
            {name: CameraImage(name, 0, image) for name, image in dressed.images(poses, 1.0, number).items()},
        )
        for number, poses in enumerate(motion)
    ]
    return Painted(person, begun, motion[0], dressed, instants)


@pytest.fixture(scope="module")
def measured(painted: Painted) -> MeasuredBody:
    return painted.measure(SETTINGS)


def _kinds(body: BodyModel) -> list[str]:
    return sorted({SegmentName(segment).kind for segment in body.segments})


def lengths_off(body: BodyModel, person: BodyModel) -> dict[str, float]:
    """Joint and axis -> share by which the length is off."""
    shape = BodyShape(person, SETTINGS)
    place = {joint.name: joint.parent_T_joint[:3, 3] for joint in body.joints}
    return {
        f"{joint.name} {'xyz'[axis]}": float(place[joint.name][axis] / joint.parent_T_joint[axis, 3] - 1.0)
        for joint, axis in shape.lengths
    }


def test_lengths_come_back(painted: Painted, measured: MeasuredBody) -> None:
    before, after = (lengths_off(body, painted.person) for body in (painted.initial, measured.body))
    assert np.abs(list(before.values())).mean() == pytest.approx(OFF, abs=1e-9)
    assert np.abs(list(after.values())).mean() < 0.5 * OFF
    bent = [abs(off) for name, off in after.items() if SegmentName(name.split()[0]).kind in BENT]
    assert len(bent) == 10 and np.mean(bent) < 0.015


def test_girths_come_back(painted: Painted, measured: MeasuredBody) -> None:
    """Radii of limbs, whatever stature they are said in."""
    radii = []
    for body in (painted.person, painted.initial, measured.body):
        surfaces = capsule_surfaces(body)
        limbs = [name for name in surfaces if SegmentName(name).kind in {"thigh", "shin", "upper_arm"}]
        radii.append(np.array([np.abs(surfaces[name].vertices[:, 0]).max() for name in limbs]))
    person, begun, found = radii
    assert np.abs(found / person - 1.0).mean() < 0.6 * np.abs(begun / person - 1.0).mean()
    assert np.abs(found - person).mean() < 0.003


def test_a_body_that_is_not_there_is_refused(painted: Painted) -> None:
    elsewhere = replace(painted, first=painted.first + np.array([[0, 0, 0, 9.0]] * 3 + [[0, 0, 0, 0.0]]))
    with pytest.raises(RangeOfMotionError):
        elsewhere.measure(SETTINGS, instants=2)

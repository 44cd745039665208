"""A recorded walk with its truth: one wrong camera changes no pose, and covariances fit the errors."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyState
from bodycam_ros.camera import CameraModel
from bodycam_ros.evaluate.comparison import TrueMotion, read_true_motion
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3, rigid, umeyama
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.replaying.camera_worker import RegistrationTask
from bodycam_ros.replaying.front_end import registered_images

pytestmark = pytest.mark.long


@dataclasses.dataclass(frozen=True)
class Walk:
    """Registrations of all images of the walk, and where its segments truly were."""

    body: BodyModel
    cameras: dict[str, CameraModel]
    matches: list[LandmarkMatches]
    true: TrueMotion

    def solve(
        self, change: Callable[[LandmarkMatches], LandmarkMatches] = lambda matches: matches
    ) -> tuple[SkeletonPipeline, list[BodyState]]:
        skeleton = SkeletonPipeline(self.body, self.cameras, PipelineSettings())
        outputs = [output for matches in self.matches for output in skeleton.add(change(matches))]
        return skeleton, [output.state for output in outputs + skeleton.flush()]


@pytest.fixture(scope="module")
def walk(shared: Path, sample: Path) -> Walk:
    recorded = shared / "dev_walk"
    with open_recording(recorded / "bag") as recording:
        cameras = {camera: recording.camera_model(camera) for camera in recording.cameras}
    task = RegistrationTask(recorded / "bag", sample / "map", PipelineSettings())
    matches = [image.matches for image in registered_images(task, cameras, jobs=2)]
    return Walk(read_body(sample / "body.yaml"), cameras, matches, read_true_motion(recorded))


@pytest.fixture(scope="module")
def undisturbed(walk: Walk) -> list[BodyState]:
    return walk.solve()[1]


@pytest.mark.parametrize("camera", ["waist_left", "torso_back"])
def test_one_wrong_camera_overrules_nobody(walk: Walk, undisturbed: list[BodyState], camera: str) -> None:
    aside = exp_se3(np.array([0.0, 0.0, 0.0, 0.4, 0.0, 0.0]))

    def moved(matches: LandmarkMatches) -> LandmarkMatches:
        if matches.camera != camera or matches.world_T_camera is None:
            return matches
        return dataclasses.replace(matches, world_T_camera=aside @ matches.world_T_camera)

    skeleton, states = walk.solve(moved)
    assert skeleton.counts.rejected == {camera: len(undisturbed)}
    ours, usual = (np.stack([state.world_T_segment for state in each]) for each in (states, undisturbed))
    assert np.linalg.norm((ours - usual)[..., :3, 3], axis=-1).max() < 0.012
    # Of a segment whose own camera is rejected nothing but its neighbours says how it is turned.
    assert np.abs(log_se3(inverse(usual) @ ours)[..., :3]).max() < np.radians(1.0)


def normalised(errors: Array, covariances: Array) -> float:
    """Mean squared error (T, N) in units of covariances (T, N, N)."""
    return float(np.einsum("ti,ti->t", errors, np.linalg.solve(covariances, errors[..., None])[..., 0]).mean())


def test_covariances_fit_the_errors(walk: Walk, undisturbed: list[BodyState]) -> None:
    """Perfect are 6 for the root and 3 for a joint, once constant frames are fitted; the root's have 1.85."""
    stamps_ns, body = np.array([state.stamp_ns for state in undisturbed]), walk.body
    there = (stamps_ns >= walk.true.stamps_ns[0]) & (stamps_ns <= walk.true.stamps_ns[-1])
    states = [state for state, covered in zip(undisturbed, there, strict=True) if covered]
    ours = np.stack([state.world_T_segment for state in states])
    true = np.stack([walk.true.at(stamps_ns[there], segment) for segment in body.segments], axis=1)
    _, R, t = umeyama(ours[..., :3, 3].reshape(-1, 3), true[..., :3, 3].reshape(-1, 3), with_scale=False)
    root = body.segment_index[body.root]
    off = log_se3(inverse(rigid(R, t) @ ours[:, root]) @ true[:, root])
    off[:, :3] -= np.median(off[:, :3], axis=0)
    assert 1.5 < normalised(off, np.stack([state.uncertainty.root for state in states])) < 12.0
    for row, joint in enumerate(body.tree_joints):
        ends = [body.segment_index[joint.parent], body.segment_index[joint.child]]
        found, truth = (
            Rotation.from_matrix(np.swapaxes(poses[:, ends[0], :3, :3], 1, 2) @ poses[:, ends[1], :3, :3])
            for poses in (ours, true)
        )
        A, B = Rotation.identity(), Rotation.identity()
        for _ in range(50):  # found = A truth B, with constant A and B
            A = (found * (truth * B).inv()).mean()
            B = ((A * truth).inv() * found).mean()
        error = (found.inv() * (A * truth * B)).as_rotvec()
        assert 0.3 < normalised(error, np.stack([state.uncertainty.joints[row] for state in states])) < 6.0, joint.name

"""The estimator against gtsam: the same factors in one nonlinear graph, eliminated and differentiated by others."""

from functools import partial

import gtsam
import numpy as np
import pytest
from moving_body import STEP_NS, body_with_cameras, lenses, seen_by

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.estimation.chain import ChainState, smooth
from bodycam_ros.estimation.estimate import Coordinates, Estimate
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.estimation.measurements import KERNEL, SLIDES_M
from bodycam_ros.estimation.motion_model import FADE_S, LASTS_S, MotionSettings
from bodycam_ros.estimation.whole_recording import SmootherSettings
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint import hinge_angle
from bodycam_ros.kinematics.tangent import TreeTangent

FRAMES, DT_S = 12, 1e-9 * STEP_NS
X, B, H, V = (gtsam.symbol_shorthand.__dict__[letter] for letter in "XBHV")  # root, ball, hinge, velocities
Place = gtsam.Pose3 | gtsam.Rot3 | Array


class Graph:
    """Instants as gtsam has them: the root's ``Pose3``, balls as ``Rot3``, hinges as angles, and the velocities."""

    def __init__(self, body: BodyModel, instants: list[ChainState]) -> None:
        self.body, self.instants, self.joints = body, instants, body.tree_joints
        self.K = 6 + sum(3 if joint.type == "ball" else 1 for joint in self.joints)
        self.graph, self.values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        tangent = TreeTangent(body, SLIDES_M)
        for t, instant in enumerate(instants):
            at = instant.estimate.at
            for key, place in zip(self.keys(t), self.places(at), strict=True):
                self.values.insert(key, place)
            self.values.insert(V(t), at.velocity)
            for row, pose, covariance in zip(
                instant.measured.cameras.rows,
                instant.measured.cameras.world_T_segment,
                instant.measured.cameras.covariances,
                strict=True,
            ):
                noise = gtsam.noiseModel.Robust.Create(
                    gtsam.noiseModel.mEstimator.Cauchy.Create(KERNEL), gtsam.noiseModel.Gaussian.Covariance(covariance)
                )
                self._add(self.keys(t), noise, partial(self._off, row, gtsam.Pose3(pose)))
            if t == 0:
                self._begin(at)
            else:
                self._go_on(t, self._accelerations(tangent, instants[t - 1].estimate))

    def keys(self, t: int) -> list[int]:
        """Of the coordinates of an instant."""
        joints = [(B if joint.type == "ball" else H)(100 * t + j) for j, joint in enumerate(self.joints)]
        return [X(t), *joints]

    def places(self, at: Coordinates) -> list[Place]:
        """Coordinates as gtsam has them."""
        turns = [
            gtsam.Rot3(R) if joint.type == "ball" else np.array([float(hinge_angle(R, joint.axis))])
            for joint, R in zip(self.joints, at.joints[:, :3, :3], strict=True)
        ]
        return [gtsam.Pose3(at.motion[0]), *turns]

    def _off(self, row: int, measured: gtsam.Pose3, q: list[Place], _: list[Array]) -> Array:
        """From the pose of a segment, by the tree, to the measured one."""
        poses = {self.body.root: q[0]}
        for j, joint in enumerate(self.joints):
            R = q[1 + j] if joint.type == "ball" else gtsam.Rot3.Expmap(q[1 + j][0] * joint.axis)
            turn = gtsam.Pose3(R, np.zeros(3))
            poses[joint.child] = (
                poses[joint.parent]
                * gtsam.Pose3(joint.parent_T_joint)
                * turn
                * gtsam.Pose3(joint.child_T_joint).inverse()
            )
        return -poses[self.body.segments[row]].localCoordinates(measured)

    def _begin(self, at: Coordinates) -> None:
        """Vague coordinates, and the velocities of people."""
        velocities = [4.0] * self.K
        noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([1.0] * self.K + velocities))
        start = self.places(at)
        self._add([*self.keys(0), V(0)], noise, lambda q, v: np.concatenate([self._step(start, q), v[0]]))

    def _go_on(self, t: int, density: Array) -> None:
        fade_s = FADE_S
        keep = np.exp(-DT_S / fade_s)
        Q = np.block([[density * DT_S**3 / 3.0, density * DT_S**2 / 2.0], [density * DT_S**2 / 2.0, density * DT_S]])
        n = 1 + len(self.joints)

        def error(q: list[Place], v: list[Array]) -> Array:
            moved = self._step(q[:n], q[n:])
            return np.concatenate([moved - fade_s * (1.0 - keep) * v[0], v[1] - keep * v[0]])

        noise = gtsam.noiseModel.Gaussian.Covariance(Q)
        self._add([*self.keys(t - 1), *self.keys(t), V(t - 1), V(t)], noise, error)

    def _step(self, start: list[Place], end: list[Place]) -> Array:
        """The increment from one place to another; joints turn in their own frame."""
        return np.concatenate([_between(a, b) for a, b in zip(start, end, strict=True)])

    def _accelerations(self, tangent: TreeTangent, belief: Estimate) -> Array:
        """Density (K, K) of accelerations that cost what those of all segments cost, by differences."""
        settings, at = MotionSettings(), belief.at
        sigmas = np.repeat([settings.angular_acceleration_sigma, settings.acceleration_sigma], 3)
        information, small = np.zeros((self.K, self.K)), 1e-6
        ends = [at.moved(small * one).poses for one in np.eye(self.K)]
        for row, pose in enumerate(at.poses):
            steps = [gtsam.Pose3.Logmap(gtsam.Pose3(pose).between(gtsam.Pose3(end[row]))) / small for end in ends]
            J = np.stack(steps, axis=1) / sigmas[:, None]
            information += J.T @ J / LASTS_S
        return np.linalg.inv(information)

    def _add(self, keys: list[int], noise: gtsam.noiseModel.Base, error) -> None:
        """A factor whose Jacobians are differences."""

        def evaluate(this: gtsam.CustomFactor, values: gtsam.Values, J: list[Array] | None) -> Array:
            read = {ord("x"): values.atPose3, ord("b"): values.atRot3}
            found = [read.get(gtsam.Symbol(key).chr(), values.atVector)(key) for key in keys]
            places = sum(gtsam.Symbol(key).chr() != ord("v") for key in keys)
            if J is not None:
                for number, place in enumerate(found):
                    columns = []
                    for one in 1e-6 * np.eye(_size(place)):
                        ends = [[*found[:number], _moved(place, step), *found[number + 1 :]] for step in (one, -one)]
                        after, before = (error(each[:places], each[places:]) for each in ends)
                        columns.append((after - before) / 2e-6)
                    J[number] = np.stack(columns, axis=1)
            return error(found[:places], found[places:])

        self.graph.add(gtsam.CustomFactor(noise, keys, evaluate))

    def solve(self) -> gtsam.Values:
        return gtsam.LevenbergMarquardtOptimizer(self.graph, self.values, gtsam.LevenbergMarquardtParams()).optimize()


def _between(a: Place, b: Place) -> Array:
    return b - a if isinstance(a, np.ndarray) else a.localCoordinates(b)


def _moved(place: Place, step: Array) -> Place:
    return place + step if isinstance(place, np.ndarray) else place.retract(step)


def _size(place: Place) -> int:
    return len(place) if isinstance(place, np.ndarray) else place.dim()


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return body_with_cameras()


@pytest.fixture(scope="module")
def estimator(body: BodyModel) -> BodyEstimator:
    rng = np.random.default_rng(4)
    estimator = BodyEstimator(body, lenses(body), SmootherSettings(output_delay="offline"))
    for frame in range(FRAMES):
        seen = {camera: seen_by(body, camera, frame, rng) for camera in body.mounts}
        assert not estimator.update(BodyFrame((frame + 1) * STEP_NS, seen))
    return estimator


def test_the_chain_is_the_graph_that_gtsam_solves(body: BodyModel, estimator: BodyEstimator) -> None:
    instants = estimator._chain
    assert not any(len(instant.measured.expected.rows) for instant in instants)
    graph = Graph(body, instants)
    values = graph.solve()
    marginals = gtsam.Marginals(graph.graph, values)
    for t, at in enumerate(smooth(instants)):
        # The chain is linearised once, going forwards: far below the cameras' 4 mm.
        for key, place in zip(graph.keys(t), graph.places(at), strict=True):
            read = {ord("x"): values.atPose3, ord("b"): values.atRot3}
            apart = _between(place, read.get(gtsam.Symbol(key).chr(), values.atVector)(key))
            assert np.abs(apart).max() < 4e-4
        assert np.abs(at.velocity - values.atVector(V(t))).max() < 0.02
    # Only the last instant of a chain has the covariance of all.
    last = instants[-1].estimate.covariance
    gap = marginals.marginalCovariance(X(FRAMES - 1)) / last[:6, :6]
    assert np.abs(np.diag(gap) - 1.0).max() < 1e-3
    velocities = np.diag(marginals.marginalCovariance(V(FRAMES - 1))) / np.diag(last)[graph.K :]
    assert np.abs(velocities - 1.0).max() < 1e-3

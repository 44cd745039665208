"""Errors of a result against a recording's truth, by the definitions of A section 5.1 and two that A lacks.

Nothing of ``bodycam_ros`` is used: the URDF, joint states and odometry of the bag are read by rosbags and yourdfpy, so
that a change of the package cannot change how it is measured. T states, S segments.
"""

import io
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml
import yourdfpy
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation, Slerp

Array = NDArray[np.float64]

_FRAME_ITERATIONS = 50
_GRID_S = 1.0 / 120.0
"""Step at which angular speeds are compared; half of it is finer than any camera's frame."""


@dataclass(frozen=True)
class Truth:
    """True trajectories of the segments at the same K times.

    Attributes:
        seconds: (K,) times [s].
        parents: segment -> the segment above it; the topmost one is absent.
        places: segment -> (K, 3) [m].
        rotations: segment -> K rotations of the segment in the world.
    """

    seconds: Array
    parents: dict[str, str]
    places: dict[str, Array]
    rotations: dict[str, Rotation]

    @classmethod
    def read(cls, recording: Path) -> "Truth":
        """Read ``truth/segments/*.tum`` and ``rig.yaml`` of a recording."""
        segments = yaml.safe_load((recording / "rig.yaml").read_text())["segments"]
        rows = {path.stem: np.loadtxt(path, ndmin=2) for path in sorted((recording / "truth/segments").glob("*.tum"))}
        seconds = next(iter(rows.values()))[:, 0]
        return cls(
            seconds,
            {child: parent for child, parent in segments.items() if parent},
            {name: row[:, 1:4] for name, row in rows.items()},
            {name: Rotation.from_quat(row[:, 4:8]) for name, row in rows.items()},
        )

    def at(self, seconds: Array, segment: str) -> tuple[Array, Rotation]:
        """Positions (T, 3) and rotations of a segment; times outside are those of the ends."""
        inside = np.clip(seconds, self.seconds[0], self.seconds[-1])
        places = np.column_stack([np.interp(inside, self.seconds, column) for column in self.places[segment].T])
        return places, Slerp(self.seconds, self.rotations[segment])(inside)


@dataclass(frozen=True)
class Result:
    """A result as a consumer of its topics meets it.

    Attributes:
        seconds: (T,) stamps [s].
        links: URDF link -> (T, 4, 4) poses in the world.
        registered: share of the cameras' images that were registered; NaN where the bag does not hold them.
    """

    seconds: Array
    links: dict[str, Array]
    registered: float

    @classmethod
    def read(cls, bag: Path) -> "Result":
        """Read a bag with /robot_description, /joint_states and /odometry.

        Raises:
            ValueError: a state has no pose of the root with the same stamp, or the bag lacks a topic.
        """
        urdf = ""
        joints = {}
        roots = {}
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            counts = {connection.topic: connection.msgcount for connection in reader.connections}
            wanted = [c for c in reader.connections if c.topic in ("/robot_description", "/joint_states", "/odometry")]
            for connection, _, raw in reader.messages(wanted):
                message: Any = reader.deserialize(raw, connection.msgtype)
                if connection.topic == "/robot_description":
                    urdf = message.data
                    continue
                stamp_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
                if connection.topic == "/joint_states":
                    joints[stamp_ns] = dict(zip(message.name, message.position, strict=True))
                else:
                    roots[stamp_ns] = _pose(message.pose.pose)
        if not urdf or not joints or not joints.keys() <= roots.keys():
            raise ValueError(f"{bag}: no /robot_description, or /joint_states without an /odometry of the same stamp")
        stamps_ns = sorted(joints)
        model = yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False, build_scene_graph=True)
        links = {link: np.empty((len(stamps_ns), 4, 4)) for link in model.link_map}
        for row, stamp_ns in enumerate(stamps_ns):
            model.update_cfg(joints[stamp_ns])
            for link, poses in links.items():
                poses[row] = roots[stamp_ns] @ model.get_transform(link)
        poses_of = {topic: count for topic, count in counts.items() if topic.endswith("/pose")}
        images = sum(counts.get(topic.replace("/pose", "/landmarks"), 0) for topic in poses_of)
        images += sum(count for t, count in counts.items() if t.endswith("/landmarks") and _pose_topic(t) not in counts)
        registered = sum(poses_of.values()) / images if images else float("nan")
        return cls(1e-9 * np.array(stamps_ns, float), links, registered)


def _pose_topic(landmarks: str) -> str:
    return landmarks.removesuffix("/landmarks") + "/pose"


def _pose(message: object) -> Array:
    pose = np.eye(4)
    p, q = message.position, message.orientation  # type: ignore[attr-defined]
    pose[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    pose[:3, 3] = p.x, p.y, p.z
    return pose


@dataclass(frozen=True)
class Score:
    """Errors of a result after one rigid alignment of the whole recording.

    Attributes:
        result: what is scored, at the T states that the truth covers.
        truth: by what.
        seconds: (T,) stamps by the truth's clock [s].
        fitted: (T,) states that alignment and constant frames are fitted to: all, or those that are not disturbed.
        coverage: share of the true frames with a state within half a frame.
    """

    result: Result
    truth: Truth
    seconds: Array
    fitted: NDArray[np.bool_]
    coverage: float

    @cached_property
    def segments(self) -> list[str]:
        """Segments of the rig that result and truth have; the topmost one included."""
        tops = set(self.truth.parents.values()) - set(self.truth.parents)
        return [s for s in self.truth.places if s in self.result.links and (s in self.truth.parents or s in tops)]

    @cached_property
    def truth_T_world(self) -> Array:
        """(4, 4) rigid alignment of all joints (A 5.1), fitted to the undisturbed states."""
        ours, theirs = self._joints(), self._true_joints()
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rigid_fit(ours[self.fitted].reshape(-1, 3), theirs[self.fitted].reshape(-1, 3))
        return pose

    @cached_property
    def position_cm(self) -> dict[str, Array]:
        """Segment -> (T,) distance of its origin from where it truly is [cm] (A figure 7b)."""
        R, t = self.truth_T_world[:3, :3], self.truth_T_world[:3, 3]
        errors = 100.0 * np.linalg.norm(self._joints() @ R.T + t - self._true_joints(), axis=2)
        return dict(zip(self.segments, errors.T, strict=True))

    @cached_property
    def rotation_deg(self) -> dict[str, Array]:
        """Segment -> (T,) geodesic error of its rotation in its parent once constant frames are fitted [deg]."""
        errors = {}
        for child, parent in self.truth.parents.items():
            if child not in self.segments or parent not in self.segments:
                continue
            ours = self._rotation(parent).inv() * self._rotation(child)
            theirs = self.truth.at(self.seconds, parent)[1].inv() * self.truth.at(self.seconds, child)[1]
            A, B = Rotation.identity(), Rotation.identity()
            for _ in range(_FRAME_ITERATIONS):
                A = (ours[self.fitted] * (theirs[self.fitted] * B).inv()).mean()
                B = ((A * theirs[self.fitted]).inv() * ours[self.fitted]).mean()
            errors[child] = np.degrees((A * theirs * B * ours.inv()).magnitude())
        return errors

    def within(self, start_s: float, end_s: float) -> NDArray[np.bool_]:
        """(T,) states from start to end, counted from the truth's first frame [s]."""
        since = self.seconds - self.truth.seconds[0]
        within: NDArray[np.bool_] = (since >= start_s) & (since < end_s)
        return within

    def link(self, name: str) -> Array:
        """(T, 4, 4) poses of a link in the truth's frame."""
        return np.asarray(self.truth_T_world @ self.result.links[name])

    def _rotation(self, segment: str) -> Rotation:
        return Rotation.from_matrix(self.result.links[segment][:, :3, :3])

    def _joints(self) -> Array:
        return np.stack([self.result.links[segment][:, :3, 3] for segment in self.segments], axis=1)

    def _true_joints(self) -> Array:
        return np.stack([self.truth.at(self.seconds, segment)[0] for segment in self.segments], axis=1)


def score(bag: Path, recording: Path, disturbed_s: tuple[float, float] | None = None, own_clock: bool = False) -> Score:
    """Score a result.

    Args:
        bag: of the result.
        recording: folder with ``truth/`` and ``rig.yaml``.
        disturbed_s: states from start to end [s] take no part in alignment and constant frames.
        own_clock: whether the result's clock has nothing to do with the truth's; then the shift is found first.
    """
    truth, result = Truth.read(recording), Result.read(bag)
    seconds = result.seconds - (_clock_shift(result, truth) if own_clock else 0.0)
    frame_s = float(np.median(np.diff(truth.seconds)))
    nearest = np.abs(seconds[None] - truth.seconds[:, None]).min(axis=1)
    inside = (seconds >= truth.seconds[0] - 1e-6) & (seconds <= truth.seconds[-1] + 1e-6)
    kept = Result(result.seconds[inside], {n: p[inside] for n, p in result.links.items()}, result.registered)
    everything = np.ones(int(inside.sum()), bool)
    scored = Score(kept, truth, seconds[inside], everything, float(np.mean(nearest <= frame_s / 2.0)))
    if disturbed_s is None:
        return scored
    return Score(kept, truth, seconds[inside], ~scored.within(*disturbed_s), scored.coverage)


def rigid_fit(a: Array, b: Array) -> tuple[Array, Array]:
    """R (3, 3), t (3,) that minimise |R a + t - b| for points (N, 3) (Umeyama 1991 without scale)."""
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    U, _, Vt = np.linalg.svd((b - mean_b).T @ (a - mean_a))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return R, mean_b - R @ mean_a


def _clock_shift(result: Result, truth: Truth) -> float:
    """Seconds by which the result's clock is ahead: where the joints turn as fast, then where they are nearest."""
    joints = [child for child, parent in truth.parents.items() if {child, parent} <= result.links.keys()]
    ours = {s: Rotation.from_matrix(result.links[s][:, :3, :3]) for s in truth.rotations if s in result.links}
    grid = np.arange(result.seconds[0], result.seconds[-1], _GRID_S)
    speeds = _speeds(result.seconds, ours, truth.parents, joints, grid)
    span = truth.seconds[-1] - truth.seconds[0]

    def difference(shift: float) -> float:
        true = _speeds(truth.seconds, truth.rotations, truth.parents, joints, grid - shift)
        both = np.isfinite(true).all(axis=0) & np.isfinite(speeds).all(axis=0)
        if both.sum() * _GRID_S < 0.5 * min(span, grid[-1] - grid[0]):
            return np.inf
        return float(np.abs(speeds - true)[:, both].clip(max=3.0).mean())

    def miss(shift: float) -> float:
        at = result.seconds - shift
        inside = (at >= truth.seconds[0]) & (at <= truth.seconds[-1])
        a = np.stack([result.links[s][inside, :3, 3] for s in joints], axis=1)
        b = np.stack([truth.at(at[inside], s)[0] for s in joints], axis=1)
        R, t = rigid_fit(a.reshape(-1, 3), b.reshape(-1, 3))
        return float(np.median(np.linalg.norm(a @ R.T + t - b, axis=2)))

    first, last = result.seconds[0] - truth.seconds[-1], result.seconds[-1] - truth.seconds[0]
    coarse = np.arange(first + 0.4 * span, last - 0.4 * span, 2.0 * _GRID_S)
    # A gait repeats: speeds alone leave several shifts, of which positions choose one.
    best = min(sorted(coarse, key=difference)[:40], key=miss)
    for halving in range(8):
        step = 2.0 * _GRID_S * 0.5**halving
        best = min((best - step, best, best + step), key=miss)
    return float(best)


def _speeds(
    seconds: Array, rotations: dict[str, Rotation], parents: dict[str, str], joints: list[str], at: Array
) -> Array:
    """(J, G) angular speeds of joints [rad/s], averaged over 50 ms, at times (G,); NaN outside."""
    rows = []
    for child in joints:
        relative = rotations[parents[child]].inv() * rotations[child]
        speed = (relative[:-1].inv() * relative[1:]).magnitude() / np.maximum(np.diff(seconds), 1e-6)
        middle = 0.5 * (seconds[1:] + seconds[:-1])
        row = np.interp(at, middle, speed, left=np.nan, right=np.nan)
        smooth = np.convolve(np.nan_to_num(row), np.ones(7) / 7.0, "same")
        rows.append(np.where(np.isnan(row), np.nan, smooth))
    return np.stack(rows)

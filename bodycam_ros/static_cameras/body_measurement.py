"""A body's lengths and girths from static cameras: track the person, measure contours, correct the body.

Gauss-Newton over all frames together. Poses are eliminated frame by frame; they are tracked anew in each round.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_shape import BodyShape, ShapeSettings
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.estimation.factors.motion import predict as predict_poses
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.shape_evidence import BULGES, ShapeEvidence
from bodycam_ros.static_cameras.start_file import PlacedBody
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.static_cameras.static_measurement import decode_images, predicted_body

_ROUNDS = 6  # of tracking the recording with a better body, at most
_CONVERGED = 0.3  # sigmas of itself by which no length changes any more
_SURFACE_SIGMA_M = 0.015  # of bulges that capsules do not have; scans of a subject have them by 3 to 18 mm
_INTERVAL_S = 0.1  # between two frames that lengths are measured in
_ALIKE_S = 1.0  # errors within this time are correlated; with 0.3 s errors of lengths are twice their sigmas
_MEASURED = 0.6  # sigma of a length over that beforehand, above which the recording does not measure it
_MIN_SEEN = 0.5  # smallest mean share of observed segments; below it the body is lost
_LONGEST_STEP = 0.2  # share of itself by which a length or girth may change in one round
_MAX_PREDICTION_S = 0.5  # for which a body is predicted; after a longer gap it stays at its last pose


@dataclass(frozen=True)
class Measure:
    """One length, or one girth.

    Attributes:
        name: of the joint, or of the segment that is as thick.
        axis: x, y or z, along which the joint is away from its parent's origin; empty for a girth.
        initial, found, sigma: initial and final estimate, and its standard deviation: [m], or times as thick as people.
        is_measured: whether the recording measures it; else it is as expected of people.
    """

    name: str
    axis: str
    initial: float
    found: float
    sigma: float
    is_measured: bool


@dataclass(frozen=True, eq=False)
class MeasuredBody:
    """A body that static cameras measured.

    Attributes:
        body: with its lengths and girths.
        lengths, girths: estimates.
        instants: frames that lengths were measured in.
        rounds: of tracking the recording.
        converged: whether no length changed any more.
        seen: mean share of observed segments.
    """

    body: BodyModel
    lengths: tuple[Measure, ...]
    girths: tuple[Measure, ...]
    instants: int
    rounds: int
    converged: bool
    seen: float


class BodyMeasurement:
    """Measures a body in the images of static cameras.

    Args:
        body: initial estimate, without equipment.
        stations: by name.
        frames: reads the recording, from its start at each call: its images, and the share of it before them.
        placed: the body in the first frame, some centimetres off.
        settings: what is expected of the body.
        region, motion: of following it.
        on_progress: called with the step and the share of it that is done.
    """

    def __init__(
        self,
        body: BodyModel,
        stations: Mapping[str, StaticCamera],
        frames: Callable[[], Iterable[tuple[float, BodyFrame]]],
        placed: Callable[[BodyModel], PlacedBody],
        settings: ShapeSettings,
        region: RegionSettings,
        motion: MotionSettings,
        on_progress: Callable[[str, float], None] = lambda step, share: None,
    ) -> None:
        self._shape = BodyShape(body, settings)
        self._size = self._shape.size + BULGES * len(body.segments)
        self._stations = stations
        self._frames = frames
        self._placed = placed
        self._unreadable: set[str] = set()
        self._region, self._motion = region, motion
        self._on_progress = on_progress

    def measure(self) -> MeasuredBody:
        """The body.

        Raises:
            RangeOfMotionError: the recording has no frame, or the body was not observed in it.
        """
        lasting, sigmas = np.zeros(self._size), np.zeros(self._shape.size)
        for number in range(1, _ROUNDS + 1):
            evidence = ShapeEvidence(self._shape, lasting, self._region)
            information, vector, count, seen = self._track(evidence, f"round {number} of at most {_ROUNDS}")
            if seen < _MIN_SEEN:
                raise RangeOfMotionError(
                    f"static cameras observed only {seen:.0%} of the body's segments on average; check that the "
                    "start is right for the first images, and the poses of the cameras"
                )
            step, sigmas = self._step(information, vector, lasting)
            lasting = lasting + step
            lengths = slice(len(self._shape.lengths))
            converged = bool((np.abs(step[lengths]) < _CONVERGED * sigmas[lengths]).all())
            if converged:
                break
        lengths_found, girths_found = self._measures(lasting[: self._shape.size], sigmas)
        body = self._shape.shaped(lasting[: self._shape.size])
        return MeasuredBody(body, lengths_found, girths_found, count, number, converged, seen)

    def _step(self, A: Array, b: Array, lasting: Array) -> tuple[Array, Array]:
        """Change (size,) of shares and bulges, and sigmas (K,) of the shares, by equations that get the priors."""
        size = self._shape.size
        information, vector = self._shape.prior(lasting[:size])
        A[:size, :size] += information
        b[:size] += vector
        bulges = np.arange(size, len(lasting))
        A[bulges, bulges] += _SURFACE_SIGMA_M**-2.0
        b[size:] -= _SURFACE_SIGMA_M**-2.0 * lasting[size:]
        covariance = np.linalg.inv(A)
        step = covariance @ b
        longest = float(np.abs(step[:size]).max())
        return step * min(1.0, _LONGEST_STEP / max(longest, 1e-12)), np.sqrt(np.diag(covariance)[:size])

    def _track(self, evidence: ShapeEvidence, step: str) -> tuple[Array, Array, int, float]:
        """Track the body through the recording, and measure its contours at intervals.

        Returns:
            Normal equations (size, size), (size,), frames measured, and mean share of observed segments.
        """
        body = evidence.body
        # Arms of a length that is not known yet are tried in vain, and each try that is kept changes what is measured.
        tracker = RegionTracker(body, evidence.surface, self._stations, self._region, tries_arms=False)
        information, vector = np.zeros((self._size, self._size)), np.zeros(self._size)
        latest: deque[tuple[int, Array]] = deque(maxlen=2)  # stamps [ns] and poses (S, 4, 4)
        seen: list[float] = []
        measured_ns = count = 0
        for share, frame in self._frames():
            self._on_progress(step, share)
            stamp_ns, images = frame.stamp_ns, decode_images(frame.images, self._stations, self._unreadable)
            if not images:
                continue
            if not latest:
                placed = self._placed(body)
                poses = tracker.initialise(images, placed.world_T_segment, placed.unplaced)
            else:
                found = tracker.measure(images, predicted_body(*_predict(latest, stamp_ns), self._motion))
                poses = found.world_T_segment
                seen.append(len(found.observed) / len(body.segments))
            latest.append((stamp_ns, poses))
            if not count or stamp_ns - measured_ns >= 1e9 * _INTERVAL_S - 1.0:
                # Frames with correlated errors count as one.
                weight = min(1.0, 1e-9 * (stamp_ns - measured_ns) / _ALIKE_S) if count else 1.0
                by_frame = evidence.measure(tracker.views, images, poses)
                information += weight * by_frame[0]
                vector += weight * by_frame[1]
                count, measured_ns = count + 1, stamp_ns
        if not seen:
            raise RangeOfMotionError("static cameras have too few images: a body is measured while it moves")
        return information, vector, count, float(np.mean(seen))

    def _measures(self, shares: Array, sigmas: Array) -> tuple[tuple[Measure, ...], tuple[Measure, ...]]:
        """Lengths and girths of shares (K,) with sigmas (K,)."""
        shape, count = self._shape, len(self._shape.lengths)
        initial, found = shape.initial, shape.initial * (1.0 + shares)
        found[count:] = [shape.shaped(shares).girths[segment] for segment in shape.thick]
        is_measured = sigmas < _MEASURED * np.sqrt(np.diag(np.linalg.inv(shape.prior(shares)[0])))
        columns = (initial, found, np.abs(initial) * sigmas, is_measured)
        rows = zip(shape.names, *(column.tolist() for column in columns), strict=True)
        measures = tuple(Measure(*name, *numbers) for name, *numbers in rows)
        return measures[:count], measures[count:]


def _predict(latest: Sequence[tuple[int, Array]], stamp_ns: int) -> tuple[Array, float]:
    """Poses (S, 4, 4) at a stamp by the latest one or two stamps [ns] and poses, and the time since then [s]."""
    latest_ns, poses = latest[-1]
    ahead_s = 1e-9 * (stamp_ns - latest_ns)
    if ahead_s > _MAX_PREDICTION_S:
        return poses, _MAX_PREDICTION_S
    if len(latest) < 2:
        return poses, ahead_s
    before_ns, before = latest[0]
    return predict_poses(before, poses, 1e-9 * (latest_ns - before_ns), ahead_s), ahead_s

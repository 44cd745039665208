"""A body's lengths and girths from static cameras: follow a person with the body so far, ask its contours, mend it.

Gauss-Newton over all instants together. Poses are eliminated instant by instant; they are found anew in each round.

Limbs are those of the proportions that calibrations are judged by, of de Leva 1996, table 4, and shoulders are as high
above the hips as the middle of the shoulders there: 515.5 mm of men, 497.9 mm of women. All that is used of that table
was compared with another transcription of it. The spine bends and the neck begins where Dumas, Cheze and Verriest 2007,
"Adjustments to McConville et al. and Young et al. body segment inertial parameters", put the joints between pelvis,
torso and head, of men 1.77 m and women 1.61 m tall. Of these four lengths no second transcription was at hand; by them
the neck's joint is 0.023 of the stature below de Leva's cervicale, which is on the skin behind it. Distances between
the centres of the hips, and of the shoulders, which tables have from skin to skin only, are round values.

Shares of the mass, centres of mass and radii of gyration are those of de Leva 1996, "Adjustments to
Zatsiorsky-Seluyanov's segment inertia parameters", table 4, the mean of women's and men's, compared with two
transcriptions of it. They scale with a segment's bone, or with the stature where a segment has no bone between two
joints. The trunk's parts hang from the cervicale: the lower one is the pelvis, the other two are the torso, which meet
where the omphalion is and not at the joint of the spine. A segment that a body lacks, such as a hand, is rigidly part
of the next one towards the root.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BONE_RADIUS_M, BodyModel, Mass, combined, sole_points
from bodycam_ros.calibration.anthropometry import LEFT, RIGHT, SegmentName
from bodycam_ros.errors import BodyError, RangeOfMotionError
from bodycam_ros.estimation.motion_model import MotionSettings, predict
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.static_cameras.body_shape import BodyShape, ShapeSettings
from bodycam_ros.static_cameras.girths import BONES, stature_of
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.shape_evidence import ShapeEvidence
from bodycam_ros.static_cameras.start_file import PlacedBody
from bodycam_ros.static_cameras.station import Image, Station
from bodycam_ros.static_cameras.station_watch import followed, with_hands
from bodycam_ros.static_cameras.surface import BULGES

_ROUNDS = 6  # of following the recording with a better body, at most
_CONVERGED = 0.3  # sigmas of itself by which no length changes any more
_SURFACE_SIGMA_M = 0.015  # of bulges that capsules do not have; scans of a subject have them by 3 to 18 mm
_INTERVAL_S = 0.1  # between two frames that lengths are measured in
_ALIKE_S = 1.0  # frames within this time err together; with 0.3 s lengths are twice as far off as their sigmas
_MEASURED = 0.6  # sigma of a length over that beforehand, above which the recording does not measure it
_MIN_SEEN = 0.5  # share of the segments that cameras must see on average, or the body is lost
_LONGEST_STEP = 0.2  # share of itself by which a length or girth may change in one round


@dataclass(frozen=True, eq=False)
class Instant:
    """What stations see at once.

    Attributes:
        stamp_ns: of the images [ns].
        images: station -> (H, W, 3) blue, green, red.
    """

    stamp_ns: int
    images: Mapping[str, Image]


@dataclass(frozen=True)
class Measure:
    """One length, or one girth.

    Attributes:
        name: of the joint, or of the segment that is as thick.
        axis: x, y or z, along which the joint is away from its parent's origin; empty for a girth.
        begun, found, sigma: what it was taken to be, is, and its standard deviation: [m], or times as thick as people.
        told: whether the recording says it; else it is what is expected of people.
    """

    name: str
    axis: str
    begun: float
    found: float
    sigma: float
    told: bool


@dataclass(frozen=True, eq=False)
class MeasuredBody:
    """A body that static cameras measured.

    Attributes:
        body: with its lengths and girths.
        lengths, girths: what became of each.
        instants: that were asked.
        rounds: that it took.
        converged: whether no length changed any more.
        seen: share of the segments that the cameras saw, on average.
    """

    body: BodyModel
    lengths: tuple[Measure, ...]
    girths: tuple[Measure, ...]
    instants: int
    rounds: int
    converged: bool
    seen: float


@dataclass(frozen=True, eq=False)
class _Round:
    """What one pass over a recording says of all that lasts."""

    information: Array
    vector: Array
    instants: int
    seen: float


class OutsideMeasurement:
    """Measures a body in the images of stations.

    Args:
        body: that is begun with, alone.
        stations: by name.
        instants: reads the recording, from its start each time.
        placed: where a body is at the first instant, some centimetres off.
        settings: what is expected.
        region, motion: of following it.
        on_progress: told the step, and the share of it that is done.
    """

    def __init__(
        self,
        body: BodyModel,
        stations: Mapping[str, Station],
        instants: Callable[[], Iterable[tuple[float, Instant]]],
        placed: Callable[[BodyModel], PlacedBody],
        settings: ShapeSettings,
        region: RegionSettings,
        motion: MotionSettings,
        on_progress: Callable[[str, float], None] = lambda step, share: None,
    ) -> None:
        self._shape, self._segment_count = BodyShape(body, settings), len(body.segments)
        self._stations, self._instants, self._placed = stations, instants, placed
        self._region, self._motion = region, motion
        self._on_progress = on_progress

    def measure(self) -> MeasuredBody:
        """The body.

        Raises:
            RangeOfMotionError: the recording has no instant, or the body was not seen in it.
        """
        size = self._shape.size
        lasting = np.zeros(size + BULGES * self._segment_count)
        sigmas = np.zeros(size)
        for number in range(1, _ROUNDS + 1):
            said = self._round(ShapeEvidence(self._shape, lasting, self._region), f"round {number}")
            if said.seen < _MIN_SEEN:
                raise RangeOfMotionError(
                    f"static cameras saw only {said.seen:.0%} of the body's segments on average; is it where it was "
                    "placed in the first images, and are the cameras where they are said to stand?"
                )
            step, sigmas = self._step(said, lasting)
            lasting = lasting + step
            lengths = slice(len(self._shape.lengths))
            converged = bool((np.abs(step[lengths]) < _CONVERGED * sigmas[lengths]).all())
            if converged:
                break
        return self._measured(lasting[:size], sigmas, said, number, converged)

    def _step(self, said: "_Round", lasting: Array) -> tuple[Array, Array]:
        """How what lasts changes, and sigmas (K,) of the shares."""
        size = self._shape.size
        information, vector = self._shape.prior(lasting[:size])
        A, b = said.information.copy(), said.vector.copy()
        A[:size, :size] += information
        b[:size] += vector
        bulges = np.arange(size, len(lasting))
        A[bulges, bulges] += _SURFACE_SIGMA_M**-2.0
        b[size:] -= _SURFACE_SIGMA_M**-2.0 * lasting[size:]
        covariance = np.linalg.inv(A)
        step = covariance @ b
        longest = float(np.abs(step[:size]).max())
        return step * min(1.0, _LONGEST_STEP / max(longest, 1e-12)), np.sqrt(np.diag(covariance)[:size])

    def _round(self, evidence: ShapeEvidence, step: str) -> _Round:
        """Follow the body through the recording, and ask every so often."""
        body = evidence.body
        tracker = RegionTracker(body, evidence.surface, self._stations, self._region)
        size = self._shape.size + BULGES * self._segment_count
        information, vector = np.zeros((size, size)), np.zeros(size)
        before = poses = np.zeros((0, 4, 4))
        latest_ns = asked_ns = 0
        dt_s = 0.0
        asked = 0
        seen: list[float] = []
        for share, instant in self._instants():
            self._on_progress(step, share)
            if not len(poses):
                placed = self._placed(body)
                poses = tracker.begin(instant.images, placed.world_T_segment, placed.unplaced)
            else:
                previous_s, dt_s = dt_s, 1e-9 * (instant.stamp_ns - latest_ns)
                expected = predict(before, poses, previous_s, dt_s) if len(before) else poses
                found = tracker.look(instant.images, followed(expected, dt_s, self._motion, previous_s))
                before, poses = poses, found.world_T_segment
                seen.append(len(found.together) / len(body.segments))
            latest_ns = instant.stamp_ns
            if not asked or latest_ns - asked_ns >= 1e9 * _INTERVAL_S - 1.0:
                said = evidence.of_instant(tracker.views, instant.images, poses)
                # Instants that err together count as one.
                weight = 1.0 if not asked else min(1.0, 1e-9 * (latest_ns - asked_ns) / _ALIKE_S)
                information += weight * said[0]
                vector += weight * said[1]
                asked, asked_ns = asked + 1, latest_ns
        if not seen:
            raise RangeOfMotionError("static cameras have too few images: a body is measured while it moves")
        return _Round(information, vector, asked, float(np.mean(seen)))

    def _measured(self, shares: Array, sigmas: Array, said: _Round, rounds: int, converged: bool) -> MeasuredBody:
        beforehand = np.sqrt(np.diag(np.linalg.inv(self._shape.prior(shares)[0])))
        known = [*zip(sigmas.tolist(), (sigmas < _MEASURED * beforehand).tolist(), strict=True)]
        begun, body = self._shape.shaped(np.zeros(self._shape.size)), self._shape.shaped(shares)
        lengths = []
        for (joint, axis), share, (sigma, told) in zip(self._shape.lengths, shares.tolist(), known, strict=False):
            at = float(joint.parent_T_joint[axis, 3])
            lengths.append(Measure(joint.name, "xyz"[axis], at, at * (1.0 + share), abs(at) * sigma, told))
        girths = [
            Measure(segment, "", begun.girths[segment], body.girths[segment], begun.girths[segment] * sigma, told)
            for segment, (sigma, told) in zip(self._shape.thick, known[len(lengths) :], strict=True)
        ]
        return MeasuredBody(body, tuple(lengths), tuple(girths), said.instants, rounds, converged, said.seen)


SHORTEST_M, TALLEST_M = 0.6, 2.75
"""Nobody stands who is shorter, and nobody was taller."""

SPINE_ABOVE_HIPS = 0.5 * (0.094 / 1.77 + 0.107 / 1.61)
NECK_ABOVE_SPINE = 0.5 * (0.477 / 1.77 + 0.429 / 1.61)
"""Height of the joint of the spine above the hips, and of the neck above that, in statures."""

_SHOULDERS = 0.5 * (0.5155 / 1.741 + 0.4979 / 1.735) - SPINE_ABOVE_HIPS
_HALF_HIPS, _HALF_SHOULDERS = 0.05, 0.105


def body_of_height(height_m: float, name: str) -> BodyModel:
    """A body of average people of a height [m], with hands; all joints are balls.

    Raises:
        BodyError: nobody is so tall.
    """
    if not SHORTEST_M <= height_m <= TALLEST_M:
        raise BodyError(f"{height_m:g} m is nobody's height; expected {SHORTEST_M:g} to {TALLEST_M:g} m, such as 1.78")
    offsets = {"torso": ("pelvis", (0.0, 0.0, SPINE_ABOVE_HIPS)), "head": ("torso", (0.0, 0.0, NECK_ABOVE_SPINE))}
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        offsets |= {
            f"upper_arm{side}": ("torso", (0.0, sign * _HALF_SHOULDERS, _SHOULDERS)),
            f"forearm{side}": (f"upper_arm{side}", (0.0, 0.0, -BONES["upper_arm"])),
            f"thigh{side}": ("pelvis", (0.0, sign * _HALF_HIPS, 0.0)),
            f"shin{side}": (f"thigh{side}", (0.0, 0.0, -BONES["thigh"])),
            f"foot{side}": (f"shin{side}", (0.0, 0.0, -BONES["shin"])),
        }
    joints = []
    for child, (parent, offset) in offsets.items():
        called = SegmentName(child)
        place = rigid(np.eye(3), height_m * np.array(offset))
        joints.append(Joint(called.joint, parent, child, "ball", place, angle_axes=called.angle_axes))
    return with_hands(BodyModel(name, "pelvis", ("pelvis", *offsets), tuple(joints), {}))


_X, _Z = np.eye(3)[[0, 2]]
_STATURES_M = np.array([1.741, 1.735])  # of the men and women of the table

# Men, then women: length [m]; share of the mass; centre's distance from the upper end in lengths; radii of gyration in
# lengths about the sagittal (forward), transverse (to the side) and longitudinal axis.
_TABLE = {
    "head": ((0.2429, 0.0694, 0.5002, 0.303, 0.315, 0.261), (0.2437, 0.0668, 0.4841, 0.271, 0.295, 0.261)),
    "upper trunk": ((0.2421, 0.1596, 0.5066, 0.505, 0.320, 0.465), (0.2280, 0.1545, 0.5050, 0.466, 0.314, 0.449)),
    "middle trunk": ((0.2155, 0.1633, 0.4502, 0.482, 0.383, 0.468), (0.2053, 0.1465, 0.4512, 0.433, 0.354, 0.415)),
    "lower trunk": ((0.1457, 0.1117, 0.6115, 0.615, 0.551, 0.587), (0.1815, 0.1247, 0.4920, 0.433, 0.402, 0.444)),
    "upper_arm": ((0.2817, 0.0271, 0.5772, 0.285, 0.269, 0.158), (0.2751, 0.0255, 0.5754, 0.278, 0.260, 0.148)),
    "forearm": ((0.2689, 0.0162, 0.4574, 0.276, 0.265, 0.121), (0.2643, 0.0138, 0.4559, 0.261, 0.257, 0.094)),
    "hand": ((0.1879, 0.0061, 0.3624, 0.288, 0.235, 0.184), (0.1701, 0.0056, 0.3427, 0.244, 0.208, 0.154)),
    "thigh": ((0.4222, 0.1416, 0.4095, 0.329, 0.329, 0.149), (0.3685, 0.1478, 0.3612, 0.369, 0.364, 0.162)),
    "shin": ((0.4403, 0.0433, 0.4395, 0.251, 0.246, 0.102), (0.4386, 0.0481, 0.4352, 0.267, 0.263, 0.092)),
    "foot": ((0.2581, 0.0137, 0.4415, 0.257, 0.245, 0.124), (0.2283, 0.0129, 0.4014, 0.299, 0.279, 0.139)),
}
"""Head from the vertex to the cervicale, upper trunk from there to the xiphion, middle trunk to the omphalion, lower
trunk to the middle of the hips; hand from the wrist to the tip of the middle finger, foot from heel to toe."""

_BONE_ENDS = {"torso": "head", "upper_arm": "forearm", "forearm": "hand", "thigh": "shin", "shin": "foot"}
"""Kind of segment -> kind of the segment at the far end of its bone."""

_OF_BOTH_SIDES = ("upper_arm", "forearm", "hand", "thigh", "shin", "foot")

_AXES = {"forearm": (1, 0, 2), "hand": (1, 0, 2), "foot": (2, 1, 0)}
"""Radii of gyration about x, y and z of a segment's frame: palms face the thighs in the N-pose, a foot lies along x."""


def person_masses(body: BodyModel, mass_kg: float) -> dict[str, Mass]:
    """Segment -> its mass, for the segments that people have; equipment and segments of other names have none.

    Args:
        body: with segments named as those of the default body, which stands straight in its N-pose.
        mass_kg: of the whole person [kg]; the sum of all masses.

    Raises:
        BodyError: the body has no pelvis, or bones that nobody has.
    """
    if "pelvis" not in body.segments:
        raise BodyError(
            f"body {body.name} has no segment pelvis; a person's mass is shared among segments named as in the default "
            "body: rename them, or leave out the mass"
        )
    stature_m = stature_of(body)
    usual = body_of_height(stature_m, body.name)
    usual_origins = dict(zip(usual.segments, usual.n_pose(np.eye(4))[:, :3, 3], strict=True))
    parts = _usual_parts(stature_m, mass_kg)
    held: dict[str, list[Mass]] = defaultdict(list)
    for segment in usual.segments:
        holder = segment
        while holder not in body.segments and (joint := usual.joint_to_parent(holder)) is not None:
            holder = joint.parent
        bone, usual_bone = _bone(body, segment), _bone(usual, segment)
        for part in parts[SegmentName(segment).kind]:
            if bone is not None and usual_bone is not None:
                held[holder].append(_scaled(part, bone, usual_bone))
            else:
                offset = usual_origins[segment] - usual_origins[holder]
                held[holder].append(Mass(part.kilograms, part.centre + offset, part.inertia))
    return {segment: combined(held[segment]) for segment in body.segments if segment in held}


def _usual_parts(stature_m: float, mass_kg: float) -> dict[str, list[Mass]]:
    """Kind of segment -> its parts in its frame, of a person of usual proportions."""
    rows = {kind: 0.5 * np.sum([_by_stature(*pair) for pair in zip(of_both, _STATURES_M, strict=True)], axis=0)
            for kind, of_both in _TABLE.items()}  # fmt: skip
    total = sum(row[1] * (2.0 if kind in _OF_BOTH_SIDES else 1.0) for kind, row in rows.items())

    def part(name: str, upper_end: Array, down: Array = -_Z) -> Mass:
        """Of a line of the table, in a frame in which its upper end and the direction from there are given."""
        length, share, along, *radii = rows[name]
        radii_m = stature_m * np.array(radii)[list(_AXES.get(name, (0, 1, 2)))]
        kilograms = mass_kg * share / total
        return Mass(kilograms, stature_m * (upper_end + along * length * down), kilograms * np.diag(radii_m**2))

    lengths = {name: row[0] for name, row in rows.items()}
    cervicale = (lengths["upper trunk"] + lengths["middle trunk"] + lengths["lower trunk"]) * _Z  # above the hips
    spine, neck = SPINE_ABOVE_HIPS * _Z, NECK_ABOVE_SPINE * _Z
    heel = sole_points(lengths["shin"])[0] * [1.0, 1.0, 0.5]
    return {
        "pelvis": [part("lower trunk", lengths["lower trunk"] * _Z)],
        "torso": [
            part("upper trunk", cervicale - spine),
            part("middle trunk", cervicale - spine - lengths["upper trunk"] * _Z),
        ],
        "head": [part("head", cervicale - spine - neck + lengths["head"] * _Z)],
        "foot": [part("foot", heel, _X)],
        **{kind: [part(kind, np.zeros(3))] for kind in ("upper_arm", "forearm", "hand", "thigh", "shin")},
    }


def _by_stature(row: Sequence[float], stature_m: float) -> Array:
    """A line of the table, with lengths and radii of gyration in statures."""
    length, share, along, *radii = row
    return np.array([length / stature_m, share, along, *(length / stature_m * np.array(radii))])


def _bone(body: BodyModel, segment: str) -> Array | None:
    """(3,) from a segment's origin to the joint at the end of its bone [m]; None if it has none."""
    name = SegmentName(segment)
    end = f"{_BONE_ENDS.get(name.kind)}{name.side}"
    ends = [joint.parent_T_joint[:3, 3] for joint in body.tree_joints if (joint.parent, joint.child) == (segment, end)]
    return ends[0] if ends and np.linalg.norm(ends[0]) > BONE_RADIUS_M else None


def _scaled(part: Mass, bone: Array, usual_bone: Array) -> Mass:
    """A part of a segment whose bone (3,) is another than the usual one (3,)."""
    along = float(part.centre @ usual_bone / (usual_bone @ usual_bone))
    scale = float(np.linalg.norm(bone) / np.linalg.norm(usual_bone))
    centre = along * bone + scale * (part.centre - along * usual_bone)
    return Mass(part.kilograms, centre, scale**2 * part.inertia)

"""What the proportions of people say about the bones of a body: a warning when they say no, never a correction.

Bones are compared with de Leva 1996, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", table 4:
lengths between joint centres of men 1.741 m and women 1.735 m tall. The better known fractions of Drillis and Contini
1966 (in Winter, *Biomechanics and Motor Control of Human Movement*, figure 4.1) run between points on the skin: their
upper arm, 0.186 of the stature, begins at the acromion and is 15 % longer than that between the centres of shoulder
and elbow, which is what cameras can find. Breadths of hips and shoulders are tabulated from skin to skin only, and
where a spine bends is a matter of the model, so neither is expected to be anything.

Only names of the default body (DESIGN 3) say anything; others are taken as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from bodycam_ros.calibration.diagnosis import BoneDiagnosis
from bodycam_ros.errors import MapError
from bodycam_ros.kinematics.joint import LONG_AXIS_Z

LEFT, RIGHT = "_left", "_right"

JOINT_ABOVE = {
    "torso": "spine",
    "head": "neck",
    "upper_arm": "shoulder",
    "forearm": "elbow",
    "hand": "wrist",
    "thigh": "hip",
    "shin": "knee",
    "foot": "ankle",
}
"""Kind of segment -> the joint that it hangs on."""

_LONG_AXIS_X = "yxz"  # a foot lies along x in the N-pose
_STRAIGHT = ("shin", "forearm")
_MOTION = {
    "torso": "bend forward and sideways, and turn the torso",
    "head": "nod, tilt and turn the head",
    "upper_arm": "raise the {limb} forward and sideways, and swing it round",
    "forearm": "bend and stretch the elbow, swing the {limb}",
    "thigh": "lift the knee forward, swing the {limb} sideways and turn it",
    "shin": "bend and stretch the knee, swing the {limb}",
    "foot": "circle the {limb}, toes up, down, in and out",
}


@dataclass(frozen=True)
class SegmentName:
    """A segment's name taken apart: ``shin_left`` is the shin of the left."""

    segment: str

    @property
    def side(self) -> str:
        """``_left``, ``_right`` or nothing."""
        return next((side for side in (LEFT, RIGHT) if self.segment.endswith(side)), "")

    @property
    def kind(self) -> str:
        """The name without its side."""
        return self.segment.removesuffix(self.side)

    @property
    def words(self) -> str:
        """In words: left shin."""
        return f"{self.side[1:]} {self.kind.replace('_', ' ')}".strip()

    @property
    def joint(self) -> str:
        """Name of the joint that the segment hangs on."""
        known = JOINT_ABOVE.get(self.kind)
        return f"{known}{self.side}" if known else f"{self.segment}_joint"

    @property
    def angle_axes(self) -> str:
        """Intrinsic order of the joint's angles, the segment's long axis in the middle."""
        return _LONG_AXIS_X if self.kind == "foot" else LONG_AXIS_Z

    @property
    def straight_in_rest(self) -> bool:
        """Whether the segment continues the one that it hangs on in a straight line in the N-pose."""
        return self.kind in _STRAIGHT

    @property
    def exercise(self) -> str:
        """What a person should do to exercise the segment's joint."""
        motion = _MOTION.get(self.kind, "turn the {limb} about at least two axes")
        return motion.format(limb=self.words)


def mirrored(name: str) -> str | None:
    """The same name on the other side; None for a name of the middle."""
    for side, other in ((LEFT, RIGHT), (RIGHT, LEFT)):
        if name.endswith(side):
            return name.removesuffix(side) + other
    return None


_MEN_M, _WOMEN_M = 1.741, 1.735
"""Statures behind the lengths of de Leva 1996, table 4."""


@dataclass(frozen=True)
class Proportion:
    """Length of a bone as a fraction of the stature.

    Attributes:
        low, high: that of women and of men, the shorter first.
    """

    low: float
    high: float

    @property
    def middle(self) -> float:
        """Of both: the body's sex is not known."""
        return 0.5 * (self.low + self.high)


def _proportion(men_m: float, women_m: float) -> Proportion:
    fractions = (men_m / _MEN_M, women_m / _WOMEN_M)
    return Proportion(min(fractions), max(fractions))


PROPORTIONS = {
    ("upper_arm", frozenset({"shoulder", "elbow"})): _proportion(0.2817, 0.2751),
    ("forearm", frozenset({"elbow", "wrist"})): _proportion(0.2689, 0.2643),
    ("thigh", frozenset({"hip", "knee"})): _proportion(0.4222, 0.3685),
    ("shin", frozenset({"knee", "ankle"})): _proportion(0.4403, 0.4386),
}
"""Segment and the joints at its ends, without their sides -> de Leva 1996, table 4."""


_TOLERANCE = 0.10  # of a bone's expected length outside the range of women and men; proportions differ by some per cent
_ASYMMETRY_M = 0.015  # whole legs differ by 5 +- 4 mm (Knutson 2005, on anatomic leg-length inequality)
_SIGMAS = 3.0  # that a difference must exceed as well, or an uncertain length is called odd
_LEAST_BONES = 3  # of known proportion that make a stature: of three, one may be wrong
_ODD_BELOW_M, _ODD_ABOVE_M = 1.2, 2.1  # a child under seven; one person in many thousands
_LEAST_M, _MOST_M = 0.6, 2.75  # no person this short stands; the tallest man known was 2.72 m


@dataclass(frozen=True)
class BoneLength:
    """Distance between two joints of one segment.

    Attributes:
        segment: that both joints are on.
        start, end: names of the joints.
        length_m, sigma_m: with its standard deviation [m].
    """

    segment: str
    start: str
    end: str
    length_m: float
    sigma_m: float

    @property
    def proportion(self) -> Proportion | None:
        """What is known of such a bone; None for one that is not in the table."""
        ends = frozenset({SegmentName(self.start).kind, SegmentName(self.end).kind})
        return PROPORTIONS.get((SegmentName(self.segment).kind, ends))

    @property
    def words(self) -> str:
        """In words: left thigh; of several bones of a segment: torso from neck to left shoulder."""
        segment = SegmentName(self.segment).words
        if self.proportion is not None:
            return segment
        return f"{segment} from {SegmentName(self.start).words} to {SegmentName(self.end).words}"

    def mirrors(self, other: "BoneLength") -> bool:
        """Whether the other is the same bone on the other side of the body."""
        ends = {_other_side(self.start), _other_side(self.end)}
        return other != self and other.segment == _other_side(self.segment) and {other.start, other.end} == ends


def expected_stature(bones: Sequence[BoneLength]) -> float | None:
    """Stature [m] that bones together let expect: the median over bones, so that an odd one does not matter.

    None when fewer than three of them are of known proportion.
    """
    statures = _statures(bones)
    return median(statures) if len(statures) >= _LEAST_BONES else None


def refuse_impossible(bones: Sequence[BoneLength]) -> None:
    """Refuse bones that no person can have, because the map that they were measured in has a wrong scale.

    One bone of known proportion is enough, for it is not wrong by half of its length.

    Raises:
        MapError: they are too short or too long for any person.
    """
    statures = _statures(bones)
    if statures and not _LEAST_M <= (stature_m := median(statures)) <= _MOST_M:
        raise MapError(
            f"by its bones this body would be {stature_m:.2f} m tall, as nobody is: {_wrong_scale(stature_m)}"
        )


def odd_scale(stature_m: float | None) -> str:
    """A warning if few people have the stature that a body's bones let expect; empty otherwise."""
    if stature_m is None or _ODD_BELOW_M <= stature_m <= _ODD_ABOVE_M:
        return ""
    return f"by its bones this body is {stature_m:.2f} m tall; unless the person is, {_wrong_scale(stature_m)}"


def _statures(bones: Sequence[BoneLength]) -> list[float]:
    """Stature by each bone of known proportion [m]."""
    return [bone.length_m / known.middle for bone in bones if (known := bone.proportion) is not None]


def _wrong_scale(stature_m: float) -> str:
    usual_m = 0.5 * (_MEN_M + _WOMEN_M)
    factor = max(stature_m / usual_m, usual_m / stature_m)
    size = "large" if stature_m > usual_m else "small"
    return (
        f"the map's scale looks wrong by a factor of about {factor:.2g} (too {size}): is the tag size in board.yaml in "
        "metres? Mend it and build the map again"
    )


def judge_bones(bones: Sequence[BoneLength]) -> list[BoneDiagnosis]:
    """Compare each bone with its other side and with the proportions of people; lengths stay as they are.

    Returns:
        A diagnosis per bone, in their order. Of a pair that differs, and of which neither is out of proportion, the
        first carries the warning.
    """
    stature_m = expected_stature(bones)
    odd = [_proportion_warning(bone, stature_m) for bone in bones]
    judged = []
    for index, bone in enumerate(bones):
        other = next((row for row, candidate in enumerate(bones) if bone.mirrors(candidate)), None)
        warning = odd[index]
        if other is not None and other > index and not odd[index] and not odd[other]:
            warning = _asymmetry_warning(bone, bones[other])
        known = bone.proportion
        judged.append(
            BoneDiagnosis(
                segment=bone.segment,
                start=bone.start,
                end=bone.end,
                length_m=bone.length_m,
                sigma_m=bone.sigma_m,
                mirror_m=None if other is None else bones[other].length_m,
                expected_m=None if known is None or stature_m is None else known.middle * stature_m,
                warning=warning,
            )
        )
    return judged


def _proportion_warning(bone: BoneLength, stature_m: float | None) -> str:
    known = bone.proportion
    if known is None or stature_m is None:
        return ""
    low_m, high_m = known.low * stature_m, known.high * stature_m
    outside_m = max(low_m - bone.length_m, bone.length_m - high_m)
    allowed_m = max(_TOLERANCE * known.middle * stature_m, _SIGMAS * bone.sigma_m)
    if outside_m <= allowed_m:
        return ""
    return (
        f"{bone.words} {_cm(bone.length_m)}: people {stature_m:.2f} m tall have {_cm_range(low_m, high_m)}; repeat "
        f"the motions of {bone.start} and {bone.end}, and check the straps of the cameras next to them"
    )


def _asymmetry_warning(bone: BoneLength, partner: BoneLength) -> str:
    difference_m = abs(bone.length_m - partner.length_m)
    sigma_m = (bone.sigma_m**2 + partner.sigma_m**2) ** 0.5
    if difference_m <= max(_ASYMMETRY_M, _SIGMAS * sigma_m):
        return ""
    return (
        f"{bone.words} {_cm(bone.length_m)}, {partner.words} {_cm(partner.length_m)}: they differ by "
        f"{1e3 * difference_m:.0f} mm; repeat the motions of {bone.start}, {bone.end}, {partner.start} and "
        f"{partner.end} unless the body is so"
    )


def _other_side(name: str) -> str:
    """The same name on the other side; a name of the middle is its own."""
    return mirrored(name) or name


def _cm(length_m: float) -> str:
    return f"{100.0 * length_m:.1f} cm"


def _cm_range(low_m: float, high_m: float) -> str:
    low, high = f"{100.0 * low_m:.0f}", f"{100.0 * high_m:.0f}"
    return f"{low} cm" if low == high else f"{low} to {high} cm"

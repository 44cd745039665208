"""Bones of a body against the proportions of people: a warning where they contradict, never a correction.

Bones are compared with those of average men and women (``body/average_person.py``, de Leva 1996, table 4). The better
known fractions of Drillis and Contini 1966 (in Winter, *Biomechanics and Motor Control of Human Movement*, figure 4.1)
run between points on the skin: their upper arm, 0.186 of the stature, begins at the acromion and is 15 % longer than
that between the centres of shoulder and elbow, which is what cameras can find. Breadths of hips and shoulders are
tabulated from skin to skin only, and where a spine bends is a matter of the model, so neither is expected to be
anything.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median

from bodycam_ros.body.average_person import (
    BONE_ENDS,
    BONE_RANGES,
    BONES,
    SHORTEST_M,
    TALLEST_M,
    USUAL_STATURE_M,
)
from bodycam_ros.body.segment_name import JOINT_ABOVE, SegmentName, mirrored
from bodycam_ros.errors import MapError

_TOLERANCE = 0.10  # of a bone's expected length outside the range of women and men; proportions differ by some per cent
_ASYMMETRY_M = 0.015  # whole legs differ by 5 +- 4 mm (Knutson 2005, on anatomic leg-length inequality)
_SIGMAS = 3.0  # that a difference must exceed as well, or an uncertain length is called odd
_LEAST_BONES = 3  # of known proportion that make a stature: of three, one may be wrong
_ODD_BELOW_M, _ODD_ABOVE_M = 1.2, 2.1  # a child under seven; one person in many thousands


@dataclass(frozen=True)
class BoneLength:
    """Distance between two joints of one segment.

    Attributes:
        segment: that both joints are on.
        start, end: names of the joints.
        length_m, sigma_m: with its standard deviation [m].
        mirror_m: length of the same bone on the other side [m]; None for a bone of the middle, or without its partner.
        expected_m: what the proportions of people let expect at this body's stature [m]; None where they give none.
        warning: why a person should look at it; empty when nothing.
    """

    segment: str
    start: str
    end: str
    length_m: float
    sigma_m: float
    mirror_m: float | None = None
    expected_m: float | None = None
    warning: str = ""

    @property
    def asymmetry_m(self) -> float | None:
        """Length less that of the other side [m]."""
        return None if self.mirror_m is None else self.length_m - self.mirror_m

    @property
    def kind(self) -> str | None:
        """Kind of the segment, if the bone is that of an average person's table; None otherwise."""
        kind, ends = SegmentName(self.segment).kind, {SegmentName(self.start).kind, SegmentName(self.end).kind}
        known = kind in BONES and ends == {JOINT_ABOVE[kind], JOINT_ABOVE[BONE_ENDS[kind]]}
        return kind if known else None

    @property
    def words(self) -> str:
        """In words: left thigh; of several bones of a segment: torso from neck to left shoulder."""
        segment = SegmentName(self.segment).words
        if self.kind is not None:
            return segment
        return f"{segment} from {SegmentName(self.start).words} to {SegmentName(self.end).words}"


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
    if statures and not SHORTEST_M <= (stature_m := median(statures)) <= TALLEST_M:
        raise MapError(
            f"from the bones this person would be {stature_m:.2f} m tall, as nobody is: {_wrong_scale(stature_m)}"
        )


def odd_scale(stature_m: float | None) -> str:
    """A warning if few people have the stature that a body's bones let expect; empty otherwise."""
    if stature_m is None or _ODD_BELOW_M <= stature_m <= _ODD_ABOVE_M:
        return ""
    return f"from its bones this person is {stature_m:.2f} m tall; if that is not true, {_wrong_scale(stature_m)}"


def _statures(bones: Sequence[BoneLength]) -> list[float]:
    """Stature by each bone of known proportion [m]."""
    return [bone.length_m / BONES[kind] for bone in bones if (kind := bone.kind) is not None]


def _wrong_scale(stature_m: float) -> str:
    factor = max(stature_m / USUAL_STATURE_M, USUAL_STATURE_M / stature_m)
    size = "large" if stature_m > USUAL_STATURE_M else "small"
    return (
        f"the map's scale is probably too {size} by a factor of about {factor:.2g}. Check that the tag size in "
        "board.yaml is in metres, correct it, and build the map again"
    )


def judge_bones(bones: Sequence[BoneLength]) -> list[BoneLength]:
    """Compare each bone with its other side and with the proportions of people; lengths stay as they are.

    Where a pair differs, and neither is out of proportion, the first carries the warning.
    """
    stature_m = expected_stature(bones)
    odd = {bone: _proportion_warning(bone, stature_m) for bone in bones}
    of_place = {(bone.segment, frozenset((bone.start, bone.end))): bone for bone in bones}
    judged: list[BoneLength] = []
    compared: set[BoneLength] = set()
    for bone in bones:
        ends = frozenset(mirrored(name) or name for name in (bone.start, bone.end))
        other = of_place.get((mirrored(bone.segment) or bone.segment, ends), bone)
        mirror_m = None if other is bone else other.length_m
        warning = odd[bone]
        if mirror_m is not None and other not in compared and not odd[bone] and not odd[other]:
            warning = _asymmetry_warning(bone, other)
        compared.add(bone)
        expected_m = None if bone.kind is None or stature_m is None else BONES[bone.kind] * stature_m
        judged.append(replace(bone, mirror_m=mirror_m, expected_m=expected_m, warning=warning))
    return judged


def _proportion_warning(bone: BoneLength, stature_m: float | None) -> str:
    if (kind := bone.kind) is None or stature_m is None:
        return ""
    low_m, high_m = (stature_m * share for share in BONE_RANGES[kind])
    outside_m = max(low_m - bone.length_m, bone.length_m - high_m)
    allowed_m = max(_TOLERANCE * BONES[kind] * stature_m, _SIGMAS * bone.sigma_m)
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
        f"{partner.end}, unless the person really is like that"
    )


def _cm(length_m: float) -> str:
    return f"{100.0 * length_m:.1f} cm"


def _cm_range(low_m: float, high_m: float) -> str:
    low, high = f"{100.0 * low_m:.0f}", f"{100.0 * high_m:.0f}"
    return f"{low} cm" if low == high else f"{low} to {high} cm"

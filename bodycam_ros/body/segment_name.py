"""Names of segments and joints: what of the body, and of which side. Only names of the default body have a meaning."""

from dataclasses import dataclass

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
    def is_known(self) -> bool:
        """Whether it is a name of the default body below the root."""
        return self.kind in JOINT_ABOVE

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

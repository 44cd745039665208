"""How other programs call the segments of a body."""

from collections import Counter
from collections.abc import Mapping, Sequence

from bodycam_ros.calibration.anthropometry import LEFT, SegmentName
from bodycam_ros.errors import BodyError

_Table = Mapping[str, str | tuple[str, str]]
"""Kind of segment -> its name, or those of the left and the right one."""


def _prefixed(kinds: Mapping[str, str], left: str, right: str) -> _Table:
    return {kind: (f"{left}{name}", f"{right}{name}") for kind, name in kinds.items()}


def _suffixed(kinds: Mapping[str, str], left: str, right: str) -> _Table:
    return {kind: (f"{name}{left}", f"{name}{right}") for kind, name in kinds.items()}


_MIXAMO_LIMBS = {
    "upper_arm": "Arm", "forearm": "ForeArm", "hand": "Hand", "thigh": "UpLeg", "shin": "Leg", "foot": "Foot",
}  # fmt: skip
_OURS = {kind: kind for kind in _MIXAMO_LIMBS}
_CMU_LIMBS = {
    "upper_arm": "humerus", "forearm": "radius", "hand": "hand", "thigh": "femur", "shin": "tibia", "foot": "foot",
}  # fmt: skip
_UNREAL_LIMBS = {
    "upper_arm": "upperarm", "forearm": "lowerarm", "hand": "hand", "thigh": "thigh", "shin": "calf", "foot": "foot",
}  # fmt: skip

BONE_NAMES: Mapping[str, _Table] = {
    # Blender mirrors what ends in .L and .R.
    "blender": {"pelvis": "hips", "torso": "spine", "head": "head", **_suffixed(_OURS, ".L", ".R")},
    "mixamo": {
        "pelvis": "mixamorig:Hips",
        "torso": "mixamorig:Spine",
        "head": "mixamorig:Head",
        **_prefixed(_MIXAMO_LIMBS, "mixamorig:Left", "mixamorig:Right"),
    },
    # Of the skeletons (ASF) of the CMU Graphics Lab's database.
    "cmu": {"pelvis": "root", "torso": "lowerback", "head": "head", **_prefixed(_CMU_LIMBS, "l", "r")},
    "unreal": {"pelvis": "pelvis", "torso": "spine_01", "head": "head", **_suffixed(_UNREAL_LIMBS, "_l", "_r")},
}
"""Convention -> what it calls the segments of the default body; others keep their names."""


def bone_names(segments: Sequence[str], convention: str | None) -> tuple[str, ...]:
    """Names of segments by a convention, or their own; without spaces, which end a name in many formats.

    Raises:
        BodyError: two would have the same name.
    """
    table = BONE_NAMES[convention] if convention else {}
    names = tuple("_".join(_named(segment, table).split()) for segment in segments)
    if twice := sorted(name for name, count in Counter(names).items() if count > 1):
        raise BodyError(f"two segments would be named {', '.join(twice)}; leave --names away, or rename one of them")
    return names


def _named(segment: str, table: _Table) -> str:
    name = SegmentName(segment)
    known = table.get(name.kind)
    if known is None or isinstance(known, str) == bool(name.side):
        return segment
    return known if isinstance(known, str) else known[0 if name.side == LEFT else 1]

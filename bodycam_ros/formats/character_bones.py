"""Which bones of a character stand for which segments: by the names of several programs, VRM's own list, or a table.

Thighs, shins, feet, arms and the head are known by their names; the pelvis, the spine and the neck by what lies between
them, since programs have from one to five bones there.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bodycam_ros.body.segment_name import LEFT, RIGHT, SegmentName
from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import printable
from bodycam_ros.files.yaml_file import read_yaml

_WORDS: Mapping[str, tuple[str, ...]] = {
    "upper_arm": ("upperarm", "arm", "uparm", "humerus"),
    "forearm": ("forearm", "lowerarm", "radius", "lowarm"),
    "hand": ("hand", "wrist"),
    "thigh": ("upleg", "upperleg", "thigh", "femur"),
    "shin": ("leg", "lowerleg", "shin", "calf", "tibia", "lowleg"),
    "foot": ("foot", "ankle"),
    "toe": ("toebase", "toe", "toes", "ball", "toe0"),
}
"""Kind of segment -> words for it: Mixamo's, Unreal's, Blender's (Rigify), the CMU's, VRM's, 3ds Max's (Biped)."""

_HEADS = ("head", "spine006")  # Rigify counts on up to the head
_VRM = {
    "head": "head", "upperArm": "upper_arm", "lowerArm": "forearm", "hand": "hand", "upperLeg": "thigh",
    "lowerLeg": "shin", "foot": "foot", "toes": "toe",
}  # fmt: skip
_PREFIX = re.compile(
    r"^(.*:|mixamorig\d*_?|def-|org-|bip\d+[ _]|bip0*\d* ?|j_bip_[clr]_|valvebiped[._]bip\d+_|jnt_|b_)", re.I
)
_SIDED = re.compile(
    r"^(?P<a>left|right)[ ._-]?(?P<x>.+)$|^(?P<y>.+?)[ ._-]?(?P<b>left|right)$"
    r"|^(?P<z>.+?)[ ._-](?P<c>[lr])(?:[ ._-]\d+)?$|^(?P<d>[lr])[ ._-](?P<w>.+)$",
    re.I,
)
_SIDES = {"l": LEFT, "r": RIGHT}

Nodes = Sequence[Mapping[str, Any]]


def named_bones(nodes: Nodes, joints: Sequence[int]) -> dict[str, int]:
    """Segment, or ``toe_left`` and ``toe_right`` -> the first joint whose name says so."""
    found: dict[str, int] = {}
    for joint in joints:
        segment = _segment(str(nodes[joint].get("name", "")))
        if segment is not None:
            found.setdefault(segment, joint)
    return found


def vrm_bones(document: Mapping[str, Any]) -> dict[str, int]:
    """The same by the list of a VRM, of version 0 or 1; empty of other files.

    Raises:
        KeyError, TypeError, AttributeError, ValueError: the list is none.
    """
    extensions = document.get("extensions", {})
    if "VRMC_vrm" in extensions:
        listed = {name: bone["node"] for name, bone in extensions["VRMC_vrm"]["humanoid"]["humanBones"].items()}
    elif "VRM" in extensions:
        listed = {bone["bone"]: bone["node"] for bone in extensions["VRM"]["humanoid"]["humanBones"]}
    else:
        return {}
    found = {}
    for name, node in listed.items():
        side = next((side for word, side in (("left", LEFT), ("right", RIGHT)) if name.startswith(word)), "")
        bare = name[len(side) - 1 :] if side else name
        kind = _VRM.get(bare[:1].lower() + bare[1:])
        if kind is not None:
            found[f"{kind}{side}"] = int(node)
    return found


def read_bone_table(path: Path, nodes: Nodes) -> dict[str, int]:
    """The same by a file of a user's: segment -> name of its bone.

    Raises:
        BodyError: the file is no such table, or names a bone that the character does not have; the message names it.
    """
    table = read_yaml(path, "table of bones", BodyError)
    if not isinstance(table, dict) or not all(isinstance(part, str) for pair in table.items() for part in pair):
        raise BodyError(f"{path}: expected lines such as 'thigh_left: LeftUpLeg', a segment and the name of its bone")
    numbers: dict[str, int] = {}
    for number, node in enumerate(nodes):
        numbers.setdefault(str(node.get("name", "")), number)
    for segment, bone in table.items():
        if bone not in numbers:
            some = ", ".join(printable(name) for name in [name for name in numbers if name][:60])
            raise BodyError(f"{path}: {segment}: the character has no bone {bone!r}; it has {some}")
        if SegmentName(segment).kind not in {*_WORDS, "pelvis", "torso", "head"}:
            raise BodyError(f"{path}: {segment}: is no segment that a character has, such as thigh_left or toe_left")
    return {segment: numbers[bone] for segment, bone in table.items()}


def _segment(name: str) -> str | None:
    """The segment that a bone's name says."""
    bare = name
    while (shorter := _PREFIX.sub("", bare)) != bare and shorter:
        bare = shorter
    if _plain(bare) in _HEADS:
        return "head"
    for side, word in _readings(name, bare):
        kind = next((kind for kind, words in _WORDS.items() if _plain(word) in words), None)
        if kind is not None:
            return f"{kind}{side}"
    return None


def _readings(name: str, bare: str) -> list[tuple[str, str]]:
    """Sides and the words beside them that a name may mean."""
    readings = []
    if of_vrm := re.match(r"^j_bip_([lr])_", name, re.I):
        readings.append((_SIDES[of_vrm[1].lower()], bare))
    if match := _SIDED.match(bare):
        side = next(match[group] for group in "abcd" if match[group])
        word = next(match[group] for group in "xyzw" if match[group])
        readings.append((_SIDES[side[0].lower()], word))
    if bare[:1].lower() in _SIDES:  # the CMU's: lfemur
        readings.append((_SIDES[bare[:1].lower()], bare[1:]))
    return readings


def _plain(word: str) -> str:
    return re.sub(r"[^a-z0-9]", "", word.lower())

"""Points of another system on our body: by well-known names, or by a user's file.

A joint's centre is the origin of its child segment. On the trunk joints differ from system to system, and markers lie
on the skin: of those only the segment is known, and their position on it is fitted.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from bodycam_ros.camera.model import OPTICAL_SUFFIX, optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.files.shown import few, other_than, shown
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.formats.captured_motion import CapturedMotion

_some = partial(few, most=20)

_SIDED_CENTRES: Mapping[str, str] = {
    # Ours, OpenSim's bodies and joints, Mixamo, CMU (ASF and BVH), Unreal, SMPL, Plug-in Gait's joint centres, OpenPose
    "thigh": "thigh hip upleg femur thighbone hjc upperleg",
    "shin": "shin knee leg tibia calf kjc lowerleg",
    "foot": "foot ankle talus ajc",
    "upper_arm": "upperarm arm humerus sjc gjc ghjc shoulder",
    "forearm": "forearm elbow lowerarm radius ulna ejc",
    "hand": "hand wrist wjc",
}
"""Kind of segment -> words for the joint to its parent, without the side."""

_SIDED_MARKERS: Mapping[str, str] = {
    "pelvis": "asi psi asis psis ilcrest pelvis",
    "thigh": "thi kne thighupper thighfront thighrear kneelat kneemed kneemedial kneelateral kneeouter kneeinner",
    "shin": "tib ank shankupper shankfront shankrear anklelat anklemed anklemedial anklelateral ankleouter ankleinner",
    "foot": "hee toe heel toetip toebase bigtoe smalltoe toelat toemed midfootlat midfootsup "
    "metatarsal calcn toes mt1 mt5",
    "torso": "sho bak acromium acromion shoulderfront clavicle scapula",
    "upper_arm": "upa elb biceps elbowlat elbowmed elbowouter elbowinner",
    "forearm": "frm wra wrb wristlat wristmed wristouter wristinner wristradius wristulna",
    "head": "fhd bhd ear eye",
}
"""Kind of segment -> words for markers on it, without the side; ``sho`` is the acromion and moves with the trunk."""

_CENTRAL: Mapping[str, str] = {
    "pelvis": "hips hip root pelvis vsacral sacr sacrum midhip sacral",
    "torso": "spine spine1 spine2 spine3 chest upperchest torso thorax lowerback upperback lowback neck c7 t8 t10 clav "
    "strn sternum sternumjug jugular spine01 spine02 spine03",
    "head": "head tophead nose headtop lhead skull",
}

_WORDS = {
    word: (kind, is_centre)
    for table, is_centre in ((_SIDED_CENTRES, True), (_SIDED_MARKERS, False))
    for kind, words in table.items()
    for word in words.split()
}
_CENTRAL_WORDS = {word: kind for kind, words in _CENTRAL.items() for word in words.split()}


@dataclass(frozen=True)
class PointSite:
    """Position of another system's point on the solved body.

    Attributes:
        link: the segment, or the optical frame of a camera.
        is_fitted: whether its position on the link is unknown, and fitted; else it is the link's origin.
    """

    link: str
    is_fitted: bool = False


def known_site(
    name: str, links: Collection[str], joints: Mapping[str, str], has_rotation: bool, others: Collection[str]
) -> PointSite | None:
    """The site of a well-known name; None of unknown names.

    Args:
        name: in the file.
        links: of the solved body.
        joints: our joint -> its child segment.
        has_rotation: the file has its rotation: so it may be a camera, and not a marker of the same name.
        others: all names in the file: beside an arm, the shoulder is the collar bone.
    """
    if (link := joints.get(name, name)) in links:
        return PointSite(link)
    if has_rotation and (camera := optical_frame(name)) in links:
        return PointSite(camera)
    if on := [link for link in links if name.startswith(f"{link}_")]:
        return PointSite(max(on, key=len), is_fitted=True)
    word = _plain_word(name)
    if word in _CENTRAL_WORDS:
        return PointSite(_CENTRAL_WORDS[word], is_fitted=True) if _CENTRAL_WORDS[word] in links else None
    side, stem = _split_side(word)
    if not side or (stem == "shoulder" and any(_split_side(_plain_word(o)) == (side, "arm") for o in others)):
        return None
    kind, is_centre = _WORDS[stem]
    segment = next((s for s in (f"{kind}_{side}", kind) if s in links), None)
    return None if segment is None else PointSite(segment, not is_centre)


def _plain_word(name: str) -> str:
    """Lower case, without separators and without the subject's name before a colon."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"^.*:", "", name).lower().removeprefix("mixamorig"))


def _split_side(word: str) -> tuple[str, str]:
    """Side and the known rest of a plain word, or "" twice; the side is first or last, whole or a letter."""
    for side in ("left", "right"):
        for mark in (side, side[0]):
            for stem in (word.removeprefix(mark), word.removesuffix(mark)):
                if stem != word and stem in _WORDS:
                    return side, stem
    return "", ""


def locate_points(
    captured: CapturedMotion, links: Collection[str], joints: Mapping[str, str], names: Path | None
) -> dict[str, PointSite]:
    """Name of a point -> its site on the body, of all points with well-known names or in a user's file.

    The file is a table: name in the other system -> our joint or camera, whose centre it is, or segment, on which it is
    a marker, or null (left out).

    Args:
        captured: the other system's motion.
        links: of the solved body.
        joints: our joint -> its child segment.
        names: the user's file, if there is one.

    Raises:
        RecordingError: the file is malformed or has unknown names, or no point is known.
    """
    found: dict[str, PointSite | None] = {}
    for name in captured.points:
        found[name] = known_site(name, links, joints, name in captured.rotations, captured.points)
    if names is not None:
        found |= _read_names(names, captured, links, joints)
    sites = {name: site for name, site in found.items() if site}
    if not sites:
        raise RecordingError(
            f"{captured.path}: none of its names is known ({_some(captured.points)}); --points POINTS.yaml says which "
            f"of our segments each is: {_some(link for link in links if not link.endswith(OPTICAL_SUFFIX))}"
        )
    return sites


def _read_names(
    path: Path, captured: CapturedMotion, links: Collection[str], joints: Mapping[str, str]
) -> dict[str, PointSite | None]:
    document = read_yaml(path, "table of names", RecordingError)
    if not isinstance(document, dict):
        raise RecordingError(f"{path}: expected a table, name in the other system -> our segment, joint or camera")
    sites: dict[str, PointSite | None] = {}
    for name, value in document.items():
        if name not in captured.points:
            raise RecordingError(
                f"{path}: {captured.path.name} has no {shown(name)}; {other_than(name, captured.points)}"
            )
        sites[str(name)] = None if value is None else _site(path, str(name), str(value), links, joints)
    return sites


def _site(path: Path, name: str, word: str, links: Collection[str], joints: Mapping[str, str]) -> PointSite:
    if word in joints:
        return PointSite(joints[word])
    if (camera := optical_frame(word)) in links:
        return PointSite(camera)
    if word in links:
        return PointSite(word, is_fitted=True)
    raise RecordingError(
        f"{path}: {shown(name)}: the body has no segment, joint or camera {shown(word)}; "
        f"{other_than(word, (*joints, *sorted(set(links) - set(joints.values()))))}"
    )

"""Which point of another system is where on our body: what is known by name, and what a user's file says instead.

A joint's centre is the origin of the segment that hangs on it. What the word means differs from system to system on the
trunk, and a marker lies on the skin: of those only the segment is known, and where on it they are is fitted.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.body.urdf import CAMERA_SUFFIX, optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.geometry import Array
from bodycam_ros.shown import shown
from bodycam_ros.yaml_file import read_yaml

_SIDED_CENTRES: Mapping[str, str] = {
    # Ours, OpenSim's bodies and joints, Mixamo, CMU (ASF and BVH), Unreal, SMPL, Plug-in Gait's joint centres, OpenPose
    "thigh": "thigh hip upleg femur thighbone hjc upperleg",
    "shin": "shin knee leg tibia calf kjc lowerleg",
    "foot": "foot ankle talus ajc",
    "upper_arm": "upperarm arm humerus sjc gjc ghjc shoulder",
    "forearm": "forearm elbow lowerarm radius ulna ejc",
    "hand": "hand wrist wjc",
}
"""Kind of segment -> words for the joint that it hangs on, without the side."""

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

_LEFT, _RIGHT = ("left", "l"), ("right", "r")


@dataclass(frozen=True, eq=False)
class Place:
    """Where on the solved body a point of another system is.

    Attributes:
        link: the segment, or the optical frame of a camera.
        at: (3,) in the link's axes [m]; None: nobody knows, it is fitted.
    """

    link: str
    at: Array | None

    @property
    def is_fitted(self) -> bool:
        """Whether where on its segment the point is has to be found."""
        return self.at is None


def known_link(
    name: str, links: Collection[str], joints: Mapping[str, str], turns: bool, others: Collection[str]
) -> tuple[str, bool] | None:
    """The link that a name means, and whether it is its origin; None of names that nobody knows.

    Args:
        name: in the file.
        links: of the solved body.
        joints: our joint -> the segment that hangs on it.
        turns: the file knows how it turns: so it may be a camera, where a marker of the same name is none.
        others: all names in the file: who has both a shoulder and an arm means the collar bone by the first.
    """
    if (link := joints.get(name, name)) in links:
        return link, True
    if turns and (camera := optical_frame(name)) in links:
        return camera, True
    if on := [link for link in links if name.startswith(f"{link}_")]:
        return max(on, key=len), False
    word = _plain(name)
    if word in {w for words in _CENTRAL.values() for w in words.split()}:
        for kind, words in _CENTRAL.items():
            if word in words.split() and kind in links:
                return kind, False
        return None
    side, stem = _sided(word)
    if side is None:
        return None
    if stem == "shoulder" and any(_sided(_plain(other)) == (side, "arm") for other in others):
        return None
    for table, is_centre in ((_SIDED_CENTRES, True), (_SIDED_MARKERS, False)):
        for kind, words in table.items():
            if stem in words.split():
                segment = next((s for s in (f"{kind}_{side}", kind) if s in links), None)
                return None if segment is None else (segment, is_centre)
    return None


def _plain(name: str) -> str:
    """Lower case, without what separates words and without the name of the subject before a colon."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"^.*:", "", name).lower().removeprefix("mixamorig"))


def _sided(word: str) -> tuple[str | None, str]:
    """Side and the rest of a plain word; the side may stand before or after, whole or as a letter."""
    known = {w for table in (_SIDED_CENTRES, _SIDED_MARKERS) for words in table.values() for w in words.split()}
    for side, marks in (("left", _LEFT), ("right", _RIGHT)):
        for mark in marks:
            for stem in (word.removeprefix(mark), word.removesuffix(mark)):
                if stem != word and stem in known:
                    return side, stem
    return None, word


_FITTED = "fitted"
_MM_PER_M = 1000.0


def places_of(
    captured: CapturedMotion, links: Collection[str], joints: Mapping[str, str], names: Path | None
) -> dict[str, Place]:
    """Name of a point -> where it is on the body, of all points that are known or that a user's file names.

    The file is a table: name in the other system -> our segment, joint or camera (its centre), or
    ``{segment: S, at: [x, y, z]}`` (in the segment's axes [mm]), or ``{segment: S, at: fitted}`` (of a marker on it
    whose place nobody measured), or null (left out).

    Args:
        captured: the other system's motion.
        links: of the solved body.
        joints: our joint -> the segment that hangs on it.
        names: the user's file, if there is one.

    Raises:
        RecordingError: the file is malformed or names what is not there, or no point is known.
    """
    found: dict[str, Place] = {}
    for name in captured.points:
        if (known := known_link(name, links, joints, name in captured.rotations, captured.points)) is not None:
            link, is_centre = known
            found[name] = Place(link, np.zeros(3) if is_centre else None)
    if names is not None:
        found = {name: place for name, place in (found | _told(names, captured, links, joints)).items() if place}
    if not found:
        raise RecordingError(
            f"{captured.path}: none of its names is known ({_some(captured.points)}); --points POINTS.yaml says which "
            f"of our segments each is: {_some(link for link in links if not link.endswith(CAMERA_SUFFIX))}"
        )
    return found


def _told(
    path: Path, captured: CapturedMotion, links: Collection[str], joints: Mapping[str, str]
) -> dict[str, Place | None]:
    document = read_yaml(path, "table of names", RecordingError)
    if not isinstance(document, dict):
        raise RecordingError(f"{path}: expected a table, name in the other system -> our segment, joint or camera")
    told: dict[str, Place | None] = {}
    for name, value in document.items():
        if name not in captured.points:
            raise RecordingError(f"{path}: {captured.path.name} has no {shown(name)}; it has {_some(captured.points)}")
        told[str(name)] = None if value is None else _place(path, str(name), value, links, joints)
    return told


def _place(path: Path, name: str, value: Any, links: Collection[str], joints: Mapping[str, str]) -> Place:
    table = value if isinstance(value, dict) else {"segment": value}
    if not {"segment"} <= set(table) <= {"segment", "at"}:
        raise RecordingError(f"{path}: {shown(name)}: expected a segment, or a table of segment and at")
    word = str(table["segment"])
    link = next((link for link in (joints.get(word, word), optical_frame(word)) if link in links), None)
    if link is None:
        raise RecordingError(
            f"{path}: {shown(name)}: the body has no segment, joint or camera {shown(word)}; it has {_some(joints)}, "
            f"{_some(set(links) - set(joints.values()))}"
        )
    return Place(link, None if table.get("at") == _FITTED else _at(path, name, table.get("at", [0, 0, 0])))


def _at(path: Path, name: str, value: Any) -> Array:
    try:
        at = np.array(value, np.float64) / _MM_PER_M
        if at.shape != (3,) or not np.isfinite(at).all():
            raise ValueError
    except (TypeError, ValueError) as error:
        raise RecordingError(
            f"{path}: {shown(name)}: at: expected [x, y, z] in the segment's axes [mm], or {_FITTED}, "
            f"not {shown(value)}"
        ) from error
    return at


def _some(names: "Collection[str] | Any") -> str:
    listed = [str(name) for name in names]
    return ", ".join(listed[:20]) + (f" and {len(listed) - 20} more" if len(listed) > 20 else "")

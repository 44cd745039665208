"""What other systems call the joints and markers of a person.

A joint's centre is the origin of the segment that hangs on it. What the word means differs from system to system on the
trunk, and a marker lies on the skin: of those only the segment is known, and where on it they are is fitted.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.geometry import Array

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
    name: str, links: Collection[str], joints: Mapping[str, str], others: Collection[str]
) -> tuple[str, bool] | None:
    """The link that a name means, and whether it is its origin; None of names that nobody knows.

    Args:
        name: in the file.
        links: of the solved body.
        joints: our joint -> the segment that hangs on it.
        others: all names in the file: who has both a shoulder and an arm means the collar bone by the first.
    """
    for link in (joints.get(name, name), optical_frame(name)):
        if link in links:
            return link, True
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

"""A small rigged humanoid as a GLB, in the names, axes, units and rest pose of several programs."""

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

SIDES = ("left", "right")
ANKLE_M = 0.07
"""Height of the ankles above the soles."""

_PARENTS = {
    "hips": None, "spine": "hips", "spine2": "spine", "chest": "spine2", "neck": "chest", "head": "neck",
    **{f"{part} {side}": above.replace("*", side) for side in SIDES for part, above in (
        ("shoulder", "chest"), ("arm", "shoulder *"), ("forearm", "arm *"), ("hand", "forearm *"),
        ("thigh", "hips"), ("shin", "thigh *"), ("foot", "shin *"), ("toe", "foot *"),
    )},
}  # fmt: skip

_WORDS = ("shoulder", "arm", "forearm", "hand", "thigh", "shin", "foot", "toe")
FAMILIES: dict[str, tuple[str, str, str]] = {
    "mixamo": (
        "mixamorig:Hips mixamorig:Spine mixamorig:Spine1 mixamorig:Spine2 mixamorig:Neck mixamorig:Head",
        "mixamorig:{Side}{}", "Shoulder Arm ForeArm Hand UpLeg Leg Foot ToeBase",
    ),
    "unreal": (
        "pelvis spine_01 spine_02 spine_03 neck_01 head", "{}_{s}",
        "clavicle upperarm lowerarm hand thigh calf foot ball",
    ),
    "blender": (
        "spine spine.001 spine.002 spine.003 spine.004 spine.006", "{}.{S}",
        "shoulder upper_arm forearm hand thigh shin foot toe",
    ),
    "cmu": (
        "root lowerback upperback thorax lowerneck head", "{s}{}", "clavicle humerus radius hand femur tibia foot toes",
    ),
    "biped": (
        "Bip01_Pelvis Bip01_Spine Bip01_Spine1 Bip01_Spine2 Bip01_Neck Bip01_Head", "Bip01_{S}_{}",
        "Clavicle UpperArm Forearm Hand Thigh Calf Foot Toe0",
    ),
    "vrm": ("a0 a1 a2 a3 a4 a5", "{S}{}", "b0 b1 b2 b3 b4 b5 b6 b7"),
    "nameless": ("a0 a1 a2 a3 a4 a5", "{S}{}", "b0 b1 b2 b3 b4 b5 b6 b7"),
}  # fmt: skip
_VRM_NAMES = ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toes")


@dataclass(frozen=True)
class Build:
    """How a character is made.

    Attributes:
        family: of names, a key of ``FAMILIES``.
        arms_deg: how far the arms are raised in the rest pose.
        leg_m, shin_share: length of a leg, and how much of it is the shin.
        hips_m: between the hips.
        unit_m: of the bones; nodes above them scale it to metres.
        z_up: the skin is built z up, facing along -y; a node above turns it.
        posed: nodes stand in another pose than the skin's.
    """

    family: str
    arms_deg: float = 90.0
    leg_m: float = 0.9
    shin_share: float = 0.5
    hips_m: float = 0.2
    unit_m: float = 1.0
    z_up: bool = False
    posed: bool = False


def bone_names(family: str) -> dict[str, str]:
    """Our name of a bone -> the family's."""
    trunk, pattern, words = FAMILIES[family]
    names = dict(zip(("hips", "spine", "spine2", "chest", "neck", "head"), trunk.split(), strict=True))
    for side in SIDES:
        for part, word in zip(_WORDS, words.split(), strict=True):
            letters = {"Side": side.capitalize(), "s": side[0], "S": side[0].upper()}
            names[f"{part} {side}"] = pattern.format(word, **letters)
    return names


def bone_places(build: Build) -> dict[str, Array]:
    """Bone -> (3,) where it begins in the rest pose, y up and facing along z [m]."""
    hip = build.leg_m + ANKLE_M
    places = {
        "hips": (0.0, hip + 0.05, 0.0), "spine": (0.0, hip + 0.1, 0.0), "spine2": (0.0, hip + 0.2, -0.01),
        "chest": (0.0, hip + 0.32, -0.01), "neck": (0.0, hip + 0.5, 0.0), "head": (0.0, hip + 0.58, 0.02),
    }  # fmt: skip
    raised = np.radians(build.arms_deg)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder = np.array([sign * 0.15, hip + 0.45, 0.0])
        along = np.array([sign * np.sin(raised), -np.cos(raised), 0.0])
        ankle = np.array([sign * 0.5 * build.hips_m, ANKLE_M, 0.0])
        knee = ankle + [0.0, build.shin_share * build.leg_m, 0.0]
        places |= {
            f"shoulder {side}": (sign * 0.04, hip + 0.43, 0.0), f"arm {side}": shoulder,
            f"forearm {side}": shoulder + 0.3 * along, f"hand {side}": shoulder + 0.55 * along,
            f"thigh {side}": (ankle[0], hip, 0.0), f"shin {side}": knee, f"foot {side}": ankle,
            f"toe {side}": ankle + [sign * 0.02, -0.05, 0.13],
        }  # fmt: skip
    return {bone: np.asarray(place, float) for bone, place in places.items()}


def write_character(build: Build, path: Path) -> Path:
    """Write a character whose bones have frames turned at random, and whose skin is triangles between its joints."""
    random = np.random.default_rng(5)
    names, places = bone_names(build.family), bone_places(build)
    file_R = Rotation.from_euler("x", 90, degrees=True).as_matrix() if build.z_up else np.eye(3)
    rest = {}
    for bone, place in places.items():
        pose = np.eye(4)
        pose[:3, :3] = file_R @ Rotation.random(random_state=random).as_matrix()
        pose[:3, 3] = file_R @ place / build.unit_m
        rest[bone] = pose
    bones = list(places)
    soles = [places[f"{part} {side}"] * [1.0, 0.0, 1.0] for part in ("foot", "toe") for side in SIDES]
    points = np.array([*places.values(), *soles]) @ file_R.T / build.unit_m
    owners = [*range(len(bones)), *(bones.index(f"{part} {side}") for part in ("foot", "toe") for side in SIDES)]
    nodes: list[dict[str, Any]] = []
    for bone in bones:
        above = _PARENTS[bone]
        local = np.linalg.inv(rest[above]) @ rest[bone] if above else rest[bone]
        turned = Rotation.from_matrix(local[:3, :3])
        if build.posed:
            turned = turned * Rotation.from_rotvec([0.3, -0.2, 0.1])
        node = {"name": names[bone], "translation": local[:3, 3].tolist(), "rotation": turned.as_quat().tolist()}
        children = [bones.index(child) for child in bones if _PARENTS[child] == bone]
        nodes.append(node | ({"children": children} if children else {}))
    back = Rotation.from_matrix(file_R.T).as_quat().tolist()
    nodes.append({"name": "Armature", "children": [0], "rotation": back, "scale": [build.unit_m] * 3})
    nodes.append({"name": "Body", "mesh": 0, "skin": 0})
    inverse = np.stack([np.linalg.inv(pose).T for pose in rest.values()]).astype("<f4")
    joints = np.zeros((len(points), 4), "u1")
    joints[:, 0] = owners
    weights = np.tile(np.array([1.0, 0.0, 0.0, 0.0], "<f4"), (len(points), 1))
    row = np.arange(len(points) - 2)
    triangles = np.stack([row, row + 1, row + 2], axis=1).reshape(-1, 1).astype("<u4")
    arrays = [
        (points.astype("<f4"), 5126, "VEC3"), (joints, 5121, "VEC4"), (weights, 5126, "VEC4"), (inverse, 5126, "MAT4"),
        (triangles, 5125, "SCALAR"),
    ]  # fmt: skip
    binary, views, accessors = b"", [], []
    for array, kind, shape in arrays:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": kind, "count": len(array), "type": shape})
        binary += array.tobytes()
    accessors[0] |= {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "somebody", "copyright": "CC0"},
        "scene": 0,
        "scenes": [{"nodes": [len(nodes) - 2, len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 4}]}],
        "skins": [{"joints": list(range(len(bones))), "inverseBindMatrices": 3}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    if build.family == "vrm":
        human = {"hips": "hips", "spine": "spine", "chest": "chest", "neck": "neck", "head": "head"}
        human |= {
            f"{side}{word}": f"{part} {side}" for side in SIDES for part, word in zip(_WORDS, _VRM_NAMES, strict=True)
        }
        listed = {name: {"node": bones.index(bone)} for name, bone in human.items()}
        document["extensions"] = {"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": listed}}}
        document["extensionsUsed"] = ["VRMC_vrm"]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path

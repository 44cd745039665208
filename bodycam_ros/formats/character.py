"""A rigged humanoid of a user's, in a GLB or a VRM: its bones as they are where its skin is not bent.

The rest pose is that of the skin's inverse bind matrices: nodes may stand in any pose of an animation. Which way it
faces, and what is up, its legs and hips tell; its size is that of the file.
"""

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.body.segment_name import LEFT, RIGHT
from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import printable
from bodycam_ros.files.yaml_file import read_bytes
from bodycam_ros.formats.character_bones import named_bones, read_bone_table, vrm_bones
from bodycam_ros.formats.gltf_container import MAGIC, accessor_values, glb_chunks
from bodycam_ros.geometry import Array, nearest_rotation, rotation_from_xyzw

_MOST_BYTES = 500_000_000
_MOST_NODES = 5000
_LIMBS = tuple(f"{kind}{side}" for side in (LEFT, RIGHT) for kind in ("thigh", "shin", "foot", "upper_arm", "forearm"))
_CHAINS = tuple(
    (f"{above}{side}", f"{below}{side}")
    for side in (LEFT, RIGHT)
    for above, below in (("thigh", "shin"), ("shin", "foot"), ("upper_arm", "forearm"), ("forearm", "hand"))
)
_ANKLE = 0.19  # above the sole, in lengths of a shin, where the skin does not tell
_HIGHEST_ANKLE = 0.5  # the same: a skin that ends so far below the ankle has something else that hangs
_LARGEST = 1e9  # of a node's numbers
_SHORTEST_M, _LONGEST_M = 0.01, 20.0  # of a leg


@dataclass(frozen=True, eq=False)
class Character:
    """A rigged humanoid, in our axes in its rest pose: x forward, y left, z up; metres as the file has them.

    Attributes:
        path: of the file.
        document, binary: as they are in it.
        parents: (N) node -> its parent; -1 of a root.
        order: (N) nodes, parents first.
        joints: nodes that are bones of skins.
        local: (N, 4, 4) poses with scale of the nodes in their parents, as the file has them.
        rest: (N, 4, 4) poses with scale of the bones in our axes; of the other nodes nothing.
        bones: segment, ``toe_left`` or ``toe_right`` -> its bone.
        spine: bones between the pelvis and the torso's, that one included, from below.
        neck: bones between the torso's and the head.
        ankle_height: of the ankles above the lowest point of the skin [m].
    """

    path: Path
    document: dict[str, Any]
    binary: bytes
    parents: tuple[int, ...]
    order: tuple[int, ...]
    joints: frozenset[int]
    local: Array
    rest: Array
    bones: Mapping[str, int]
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    ankle_height: float

    def place(self, segment: str) -> Array:
        """(3,) where a segment's bone begins in the rest pose [m]."""
        place: Array = self.rest[self.bones[segment], :3, 3]
        return place

    def leg_length(self, side: str) -> float:
        """Length of thigh and shin of a side [m]."""
        hip, knee, ankle = (self.place(f"{kind}{side}") for kind in ("thigh", "shin", "foot"))
        return float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))


def read_character(path: Path, table: Path | None) -> Character:
    """A character of a GLB or VRM.

    Args:
        path: the file.
        table: YAML with the names of its bones, segment -> name, where they are not known by their names.

    Raises:
        BodyError: the file cannot be read, has no skin or is no humanoid, or bones are not found; the message names
            the file and them.
    """
    content = read_bytes(path, "character", BodyError, _MOST_BYTES)
    if content[:4] != MAGIC:
        raise BodyError(f"{path}: is no binary glTF; expected a character as .glb or .vrm: other programs export it")
    try:
        document, binary = glb_chunks(content)
        return _character(path, document, binary, table)
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, struct.error, RecursionError) as error:
        told = "it is no JSON" if isinstance(error, json.JSONDecodeError) else str(error)
        raise BodyError(f"{path}: cannot read this character: a part is missing or of another kind: {told}") from error


def _character(path: Path, document: Any, binary: bytes, table: Path | None) -> Character:
    nodes: Sequence[Mapping[str, Any]] = document["nodes"]
    if not isinstance(document["asset"], dict) or "uri" in document["buffers"][0]:
        raise ValueError("its first buffer is in another file, or it is no glTF")
    if not document.get("skins"):
        raise BodyError(f"{path}: has no skin, so no bones move it; expected a rigged character")
    if len(nodes) > _MOST_NODES:
        raise BodyError(f"{path}: has {len(nodes)} nodes, more than {_MOST_NODES}; a character has some hundreds")
    parents = [-1] * len(nodes)
    for number, node in enumerate(nodes):
        for child in node.get("children", []):
            parents[child] = number
    order = _parents_first(parents)
    local = np.stack([_local(node) for node in nodes])
    world = np.empty_like(local)
    for number in order:
        over = parents[number]
        world[number] = world[over] @ local[number] if over >= 0 else local[number]
    bind = _bind_poses(document, binary, world)
    joints = [node for node in order if node in bind]
    bones = named_bones(nodes, joints) | vrm_bones(document)
    if table is not None:
        bones |= read_bone_table(table, nodes)
    if missing := [segment for segment in _LIMBS if bones.get(segment) not in bind]:
        names = ", ".join(printable(str(nodes[joint].get("name", ""))) for joint in joints[:80])
        raise BodyError(
            f"{path}: no bone is known to be {', '.join(missing)}; name them in a file, in lines such as "
            f"'{missing[0]}: NAME', and give it with --bones. The character's bones are {names}"
        )
    bones = {segment: bone for segment, bone in bones.items() if bone in bind}
    for above, below in _CHAINS:
        if below in bones and bones[above] not in _path_up(bones[below], parents):
            raise BodyError(
                f"{path}: the bone of {below} does not hang on that of {above}; expected a skeleton, as exporters make "
                "of a rig ('deform bones only')"
            )
    spine, neck = _trunk(path, bones, parents)
    rest = _rest(path, bind, bones, len(nodes))
    ankles = np.mean([rest[bones[f"foot{side}"], 2, 3] for side in (LEFT, RIGHT)])
    shin = np.mean([np.linalg.norm(np.subtract(*(rest[bones[f"{k}{s}"], :3, 3] for k in ("foot", "shin"))))
                    for s in (LEFT, RIGHT)])  # fmt: skip
    height = float(ankles - _lowest(document, binary, bind, rest, bones))
    if not 0.0 < height < _HIGHEST_ANKLE * shin:
        height = float(_ANKLE * shin)
    return Character(
        path, document, binary, tuple(parents), tuple(order), frozenset(joints), local, rest, bones, spine, neck, height
    )


def _parents_first(parents: Sequence[int]) -> list[int]:
    depths = [len(_path_up(node, parents)) for node in range(len(parents))]
    return sorted(range(len(parents)), key=lambda node: (depths[node], node))


def _path_up(node: int, parents: Sequence[int]) -> list[int]:
    """A node, its parent, and so on."""
    path = [node]
    while parents[path[-1]] >= 0:
        path.append(parents[path[-1]])
        if len(path) > len(parents):
            raise ValueError("a node is its own ancestor")
    return path


def _local(node: Mapping[str, Any]) -> Array:
    """Pose with scale (4, 4) of a node in its parent."""
    if "matrix" in node:
        return _numbers(node["matrix"], 16).reshape(4, 4).T
    T = np.eye(4)
    rotation = rotation_from_xyzw(_numbers(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), 4))
    T[:3, :3] = rotation * _numbers(node.get("scale", (1.0, 1.0, 1.0)), 3)
    T[:3, 3] = _numbers(node.get("translation", (0.0, 0.0, 0.0)), 3)
    return T


def _numbers(given: Any, count: int) -> Array:
    values = np.array(given, np.float64)
    if values.shape != (count,) or not (np.abs(values) < _LARGEST).all():
        raise ValueError(f"a node has a place, rotation, scale or matrix other than {count} numbers below {_LARGEST:g}")
    return values


def _bind_poses(document: Any, binary: bytes, world: Array) -> dict[int, Array]:
    """Joint -> its pose with scale (4, 4) where the skin is not bent, in the skin's frame scaled to metres.

    Joints without inverse bind matrices, or with compressed ones, are as the nodes are.
    """
    bind: dict[int, Array] = {}
    for skin in sorted(document["skins"], key=lambda skin: -len(skin["joints"])):
        joints = skin["joints"]
        matrices, accessor = None, skin.get("inverseBindMatrices")
        if accessor is not None and "bufferView" in document["accessors"][accessor]:
            matrices = accessor_values(document, [binary], accessor).reshape(-1, 4, 4).transpose(0, 2, 1)
        if matrices is None:
            poses = world[joints]
        else:
            poses = np.linalg.inv(matrices[: len(joints)])
            scale = np.median(
                np.abs(np.linalg.det((world[joints] @ matrices[: len(joints)])[:, :3, :3])) ** (1.0 / 3.0)
            )
            poses[:, :3] *= scale
        for joint, pose in zip(joints, poses, strict=True):
            bind.setdefault(joint, pose)
    return bind


def _trunk(path: Path, bones: dict[str, int], parents: Sequence[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Bones of the spine and the neck; adds the pelvis and the torso to the bones.

    Raises:
        BodyError: legs and arms do not hang together.
    """
    torso = bones.setdefault("torso", _common([bones[f"upper_arm{side}"] for side in (LEFT, RIGHT)], parents))
    thighs = [bones[f"thigh{side}"] for side in (LEFT, RIGHT)]
    pelvis = bones.setdefault("pelvis", _common([*thighs, torso], parents) if torso >= 0 else -1)
    if pelvis < 0 or torso < 0 or pelvis == torso:
        raise BodyError(f"{path}: legs and arms do not hang on one spine; name its bones pelvis and torso with --bones")
    above = _path_up(torso, parents)
    if pelvis not in above:
        raise BodyError(f"{path}: the bone of the torso does not hang on that of the pelvis; name both with --bones")
    spine = tuple(reversed(above[: above.index(pelvis)]))
    neck: tuple[int, ...] = ()
    if "head" in bones:
        to_head = _path_up(bones["head"], parents)
        if torso not in to_head:
            del bones["head"]
        else:
            neck = tuple(reversed(to_head[1 : to_head.index(torso)]))
    return spine, neck


def _common(nodes: Sequence[int], parents: Sequence[int]) -> int:
    """The nearest ancestor of several nodes that is none of them; -1 if there is none."""
    paths = [_path_up(node, parents) for node in nodes]
    shared = set.intersection(*map(set, paths)) - set(nodes)
    return next((node for node in paths[0] if node in shared), -1)


def _rest(path: Path, bind: Mapping[int, Array], bones: Mapping[str, int], count: int) -> Array:
    """(count, 4, 4) bind poses in our axes, by the legs and hips.

    Raises:
        BodyError: it has no legs, or they are of no size.
    """
    at = {segment: bind[bone][:3, 3] for segment, bone in bones.items()}
    hips = 0.5 * (at["thigh_left"] + at["thigh_right"])
    leg = float(np.mean([
        np.linalg.norm(at[f"shin{s}"] - at[f"thigh{s}"]) + np.linalg.norm(at[f"foot{s}"] - at[f"shin{s}"])
        for s in (LEFT, RIGHT)
    ]))  # fmt: skip
    left = at["thigh_left"] - at["thigh_right"]
    up = 0.5 * (at["upper_arm_left"] + at["upper_arm_right"]) - hips
    if not _SHORTEST_M < leg < _LONGEST_M or np.linalg.norm(np.cross(left, up)) < 1e-3 * leg**2:
        raise BodyError(f"{path}: legs of {leg:.3g} m; expected a humanoid of {_SHORTEST_M:g} to {_LONGEST_M:g} m")
    up = up / np.linalg.norm(up)
    left = left - (left @ up) * up
    left = left / np.linalg.norm(left)
    ours_R_skin = np.stack([np.cross(left, up), left, up])
    # Characters are built along the axes of their file; hips and shoulders are not quite.
    straight = np.round(ours_R_skin)
    if np.abs(np.linalg.det(straight) - 1.0) < 1e-6 and np.allclose(straight @ straight.T, np.eye(3)):
        ours_R_skin = straight
    rest = np.tile(np.eye(4), (count, 1, 1))
    for joint, pose in bind.items():
        rest[joint, :3] = ours_R_skin @ pose[:3]
    return rest


def _lowest(document: Any, binary: bytes, bind: Mapping[int, Array], rest: Array, bones: Mapping[str, int]) -> float:
    """Height of the lowest point of the skin in the rest pose; infinite where its points cannot be read."""
    bone = bones["thigh_left"]
    # The same bone in both frames has the rotation and the scale between them.
    ours_T_skin = rest[bone] @ np.linalg.inv(bind[bone])
    lowest, scale = np.inf, 1.0
    for skin_number, skin in enumerate(document["skins"]):
        if bone not in skin["joints"] or "inverseBindMatrices" not in skin:
            continue
        scale = _skin_scale(document, binary, skin, bone, bind)
        meshes = [n["mesh"] for n in document["nodes"] if n.get("skin") == skin_number and "mesh" in n]
        for primitive in (part for mesh in meshes for part in document["meshes"][mesh]["primitives"]):
            accessor = primitive["attributes"]["POSITION"]
            known = document["accessors"][accessor]
            if "bufferView" not in known or known["componentType"] != 5126:
                continue
            points = scale * accessor_values(document, [binary], accessor)
            lowest = min(lowest, float((points @ ours_T_skin[2, :3] + ours_T_skin[2, 3]).min()))
    return lowest


def _skin_scale(document: Any, binary: bytes, skin: Any, bone: int, bind: Mapping[int, Array]) -> float:
    """Metres to a unit of a skin's points."""
    matrices = accessor_values(document, [binary], skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    unscaled = np.linalg.inv(matrices[skin["joints"].index(bone)])
    return float(np.cbrt(np.linalg.det(bind[bone][:3, :3]) / np.linalg.det(unscaled[:3, :3])))


def rotation_of(pose: Array) -> Array:
    """Rotation (3, 3) of a pose with scale."""
    return nearest_rotation(pose[:3, :3])

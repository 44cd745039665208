"""The motion of a solved body on a character of a user's: ``bodycam export --to glb --character``.

Each bone turns by what its segment turned since both had the character's rest pose. The character has its own size: it
walks where the body walked, larger or smaller as its legs are longer or shorter, hips as high as its legs carry them,
and its soles move as the body's do: legs are bent so that ankles are where soles want them.
"""

from typing import Any

import numpy as np

from bodycam_ros.body.body_model import BodyModel, sole_points
from bodycam_ros.body.segment_name import LEFT, RIGHT
from bodycam_ros.errors import BodyError, SettingsError
from bodycam_ros.formats.character import Character, read_character, rotation_of
from bodycam_ros.formats.figure import WORLD_R_REST
from bodycam_ros.formats.gltf_container import GltfBuffer, continuous_quaternions, glb_content
from bodycam_ros.formats.sampled_motion import UP_AXES, MotionOptions, SampledMotion
from bodycam_ros.geometry import Array, exp_so3, quaternion_xyzw, rotation_between, shortest_turn

_SCENE_R_OURS = UP_AXES["y"]  # glTF's axes
_STRETCHED = 0.9995  # share of a leg's length beyond which the hips come down to the ankle
_FORWARD = 0.1  # how much a straight knee prefers to bend forward
_ARM_OUT = 0.12  # how far arms that hang are away from the body, as a slope
_SIDES = (LEFT, RIGHT)


def write_character(motion: SampledMotion, options: MotionOptions) -> bytes:
    """The character's GLB with the motion as its only animation.

    Raises:
        BodyError: the character cannot be read or is no humanoid, or the body lacks a pelvis.
        SettingsError: a rest pose, names or a surface are given, which the character has, or an environment.
    """
    if given := [f"--{name}" for name in ("pose", "names", "surface") if getattr(options, name) is not None]:
        raise SettingsError(f"{', '.join(given)} has no effect on a character, which has its own; leave it out")
    if options.environment is not None or options.travel is not None:
        raise SettingsError(
            "--environment, --travel: a character has its own size, by which it would leave pedals and ground; leave "
            "them out, or leave out --character"
        )
    assert options.character is not None
    character = read_character(options.character, options.bones)
    turned, root = retargeted(motion, character)
    try:
        return _written(motion, character, turned, root)
    except (ValueError, TypeError) as error:
        raise BodyError(f"{character.path}: cannot write this character again: {error}") from error


def retargeted(motion: SampledMotion, character: Character) -> tuple[dict[int, Array], Array]:
    """Bone -> its rotations (T, 3, 3) in our world's axes, and places (T, 3) of the pelvis' bone [m].

    Raises:
        BodyError: the body has no pelvis.
    """
    body = motion.body
    if "pelvis" not in body.segments:
        raise BodyError(f"body {body.name}: has no pelvis, so a character cannot follow it")
    turns = _turns_since_rest(motion, character)
    hips, ankles = _leg_ends(motion, character, turns)
    for side, ankle in ankles.items():
        upper, lower = _bent_leg(character, side, hips[side], ankle, turns)
        turns[f"thigh{side}"], turns[f"shin{side}"] = upper, lower
    pelvis = character.place("pelvis") - _hip_middle(character)
    middle = np.mean([hips[side] for side in _SIDES], axis=0)
    by_bone = {character.bones[segment]: turn for segment, turn in turns.items()}
    below = turns["pelvis"]
    for side, outward in zip(_SIDES, (_ARM_OUT, -_ARM_OUT), strict=True):
        if f"upper_arm{side}" not in turns:  # arms that nobody measured hang
            arm = character.place(f"forearm{side}") - character.place(f"upper_arm{side}")
            hanging = shortest_turn(arm, np.array([0.0, outward, -1.0]))
            by_bone[character.bones[f"upper_arm{side}"]] = turns.get("torso", below) @ hanging
    for number, bone in enumerate(character.spine, start=1):
        if "torso" in turns:
            by_bone[bone] = rotation_between(below, turns["torso"], number / len(character.spine))
    for number, bone in enumerate(character.neck, start=1):
        if "head" in turns:
            by_bone[bone] = rotation_between(turns["torso"], turns["head"], number / (len(character.neck) + 1))
    return (
        {bone: turn @ rotation_of(character.rest[bone]) for bone, turn in by_bone.items()},
        middle + below @ pelvis,
    )


def _turns_since_rest(motion: SampledMotion, character: Character) -> dict[str, Array]:
    """Segment -> rotations (T, 3, 3) since the body had the character's rest pose, of those that both have."""
    body, turns = motion.body, {}
    own: dict[str, Array] = {}
    for segment in motion.body_segments:
        if segment not in character.bones:
            continue
        parent = motion.parents.get(segment, "")
        rest_R_segment = own.get(parent, np.eye(3)) if _is_limb(segment) else np.eye(3)
        toe = segment.replace("foot", "toe")
        if segment.startswith("foot"):
            rest_R_segment = np.eye(3)
            if toe in character.bones:
                ahead = character.place(toe) - character.place(segment)
                yaw = np.arctan2(ahead[1], ahead[0])
                rest_R_segment = exp_so3(np.array([0.0, 0.0, yaw]))
        elif (below := _next_of(body, segment)) is not None and below in character.bones and _is_limb(segment):
            joint = body.joint_to_parent(below)
            assert joint is not None
            bone = rest_R_segment @ joint.parent_T_joint[:3, 3]
            rest_R_segment = shortest_turn(bone, character.place(below) - character.place(segment)) @ rest_R_segment
        elif segment.startswith("forearm") and segment.replace("forearm", "hand") in character.bones:
            hand = character.place(segment.replace("forearm", "hand")) - character.place(segment)
            rest_R_segment = shortest_turn(rest_R_segment @ np.array([0.0, 0.0, -1.0]), hand) @ rest_R_segment
        own[segment] = rest_R_segment
        turns[segment] = motion.segment_poses(segment)[:, :3, :3] @ rest_R_segment.T
    return turns


def _is_limb(segment: str) -> bool:
    return segment.endswith(_SIDES)


def _next_of(body: BodyModel, segment: str) -> str | None:
    """The only segment of a limb that hangs on another."""
    below = [joint.child for joint in body.tree_joints if joint.parent == segment and joint.child.endswith(_SIDES)]
    return below[0] if len(below) == 1 else None


def _leg_ends(
    motion: SampledMotion, character: Character, turns: dict[str, Array]
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Side -> places (T, 3) of the character's hip [m]; side -> places (T, 3) of its ankle, of legs that move."""
    body, pelvis = motion.body, motion.segment_poses("pelvis")
    joints = {joint.child: joint.parent_T_joint[:3, 3] for joint in body.tree_joints}
    sides = [side for side in _SIDES if all(f"{kind}{side}" in turns for kind in ("thigh", "shin", "foot"))]
    both = all(f"thigh{side}" in joints for side in _SIDES)
    hip = 0.5 * (joints[f"thigh{LEFT}"] + joints[f"thigh{RIGHT}"]) if both else np.zeros(3)
    scale, lift = 1.0, 0.0
    soles = {side: -sole_points(float(np.linalg.norm(joints[f"foot{side}"])))[0, 2] for side in sides}
    if sides:
        own = np.mean([[np.linalg.norm(joints[f"{kind}{side}"]) for side in sides] for kind in ("shin", "foot")]) * 2.0
        scale = float(np.mean([character.leg_length(side) for side in sides]) / own)
        lift = character.ankle_height - scale * float(np.mean([*soles.values()]))
    up = np.array([0.0, 0.0, 1.0])
    middle = scale * (pelvis[:, :3, 3] + pelvis[:, :3, :3] @ hip) + lift * up
    offsets = {side: character.place(f"thigh{side}") - _hip_middle(character) for side in _SIDES}
    hips = {side: middle + turns["pelvis"] @ offset for side, offset in offsets.items()}
    ankles = {}
    for side in sides:
        foot = motion.segment_poses(f"foot{side}")
        above_sole = foot[:, :3, 2]  # z of the foot
        ankles[side] = scale * (foot[:, :3, 3] - soles[side] * above_sole) + character.ankle_height * above_sole
    drop = np.zeros(len(middle))
    for side, ankle in ankles.items():
        reach = _STRETCHED * character.leg_length(side)
        across = np.linalg.norm((hips[side] - ankle)[:, :2], axis=1)
        allowed = np.sqrt(np.maximum(reach**2 - across**2, 0.0))
        drop = np.maximum(drop, (hips[side] - ankle)[:, 2] - allowed)
    return {side: hip - drop[:, None] * up for side, hip in hips.items()}, ankles


def _hip_middle(character: Character) -> Array:
    middle: Array = 0.5 * (character.place("thigh_left") + character.place("thigh_right"))
    return middle


def _bent_leg(
    character: Character, side: str, hip: Array, ankle: Array, turns: dict[str, Array]
) -> tuple[Array, Array]:
    """Turns (T, 3, 3) of thigh and shin since rest with which the ankle is where it should be.

    Two bones, in closed form. The knee bends in the plane in which the body's does.
    """
    thigh_rest = character.place(f"shin{side}") - character.place(f"thigh{side}")
    shin_rest = character.place(f"foot{side}") - character.place(f"shin{side}")
    thigh, shin = turns[f"thigh{side}"] @ thigh_rest, turns[f"shin{side}"] @ shin_rest
    upper, lower = np.linalg.norm(thigh_rest), np.linalg.norm(shin_rest)
    reach = ankle - hip
    distance = np.linalg.norm(reach, axis=1, keepdims=True)
    axis = reach / np.maximum(distance, 1e-9)
    distance = np.clip(distance, abs(upper - lower) + 1e-6, (upper + lower) * (1.0 - 1e-9))
    forward = thigh + _FORWARD * upper * turns[f"thigh{side}"][:, :, 0]
    pole = forward - np.sum(forward * axis, axis=1, keepdims=True) * axis
    pole = pole / np.maximum(np.linalg.norm(pole, axis=1, keepdims=True), 1e-9)
    along = (upper**2 - lower**2 + distance**2) / (2.0 * distance)
    knee = along * axis + np.sqrt(np.maximum(upper**2 - along**2, 0.0)) * pole
    return (
        shortest_turn(thigh, knee) @ turns[f"thigh{side}"],
        shortest_turn(shin, distance * axis - knee) @ turns[f"shin{side}"],
    )


def _written(motion: SampledMotion, character: Character, turned: dict[int, Array], root: Array) -> bytes:
    """The GLB: nodes in the rest pose, upright and facing the viewer, and the animation."""
    document, known = dict(character.document), motion.known
    rest_world, rest_local = _rest_nodes(character)
    nodes = [dict(node) for node in document["nodes"]]
    for joint in character.joints:
        nodes[joint].pop("matrix", None)
        nodes[joint] |= _parts(rest_local[joint])
    buffer = GltfBuffer(character.binary, document.get("bufferViews", []), document.get("accessors", []))
    times = buffer.add(motion.seconds[known, None].astype(np.float32), with_range=True)
    pelvis = character.bones["pelvis"]
    parent = character.parents[pelvis]
    scene = root[known] @ _SCENE_R_OURS.T
    above = np.linalg.inv(rest_world[parent]) if parent >= 0 else np.eye(4)
    outputs = [buffer.add((scene @ above[:3, :3].T + above[:3, 3]).astype(np.float32))]
    targets: list[dict[str, Any]] = [{"node": pelvis, "path": "translation"}]
    rotations: dict[int, Array] = {}
    for node in character.order:
        over = character.parents[node]
        if node in turned:
            rotations[node] = _SCENE_R_OURS @ turned[node][known]
            parent_R = rotations.get(over)
            if parent_R is None:
                parent_R = rotation_of(rest_world[over]) if over >= 0 else np.eye(3)
            local = np.swapaxes(parent_R, -1, -2) @ rotations[node]
            outputs.append(buffer.add(continuous_quaternions(quaternion_xyzw(local)).astype(np.float32)))
            targets.append({"node": node, "path": "rotation"})
        elif over in rotations:
            rotations[node] = rotations[over] @ rotation_of(rest_local[node])
    samplers = [{"input": times, "output": output, "interpolation": "LINEAR"} for output in outputs]
    channels = [{"sampler": row, "target": target} for row, target in enumerate(targets)]
    asset = {"generator": "bodycam_ros", **{k: v for k, v in document["asset"].items() if k != "generator"}}
    document |= {
        "nodes": nodes,
        "animations": [{"name": motion.name, "samplers": samplers, "channels": channels}],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{**document["buffers"][0], "byteLength": len(buffer.content)}, *document["buffers"][1:]],
    }
    return glb_content({"asset": asset, **{k: v for k, v in document.items() if k != "asset"}}, bytes(buffer.content))


def _rest_nodes(character: Character) -> tuple[Array, Array]:
    """Poses with scale (N, 4, 4) of the nodes in the scene, and in their parents, in the rest pose on the ground."""
    ground = np.mean([character.place(f"foot{side}")[2] for side in _SIDES]) - character.ankle_height
    middle = _hip_middle(character)
    offset = np.array([middle[0], middle[1], ground])
    scene_R_ours = _SCENE_R_OURS @ WORLD_R_REST
    world, local = np.empty_like(character.rest), character.local.copy()
    for node in character.order:
        over = character.parents[node]
        above = world[over] if over >= 0 else np.eye(4)
        if node in character.joints:
            world[node] = character.rest[node]
            world[node, :3, 3] -= offset
            world[node, :3] = scene_R_ours @ world[node, :3]
            local[node] = np.linalg.inv(above) @ world[node]
        else:
            world[node] = above @ local[node]
    return world, local


def _parts(pose: Array) -> dict[str, list[float]]:
    """Translation, rotation and scale of a node."""
    return {
        "translation": pose[:3, 3].tolist(),
        "rotation": quaternion_xyzw(rotation_of(pose)).tolist(),
        "scale": np.linalg.norm(pose[:3, :3], axis=0).tolist(),
    }

"""Athletes and what they ride, stand on or lift, of whom everything is known: 13 segments, 16 cameras (B 3.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Attachment, Equipment, SegmentMotion
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint
from helpers.known_motion import BODY
from helpers.two_link_limb import two_links

Array = NDArray[np.float64]

RATE_HZ = 30.0
CRANK_M = 0.17
BALL_OF_FOOT, GRIP = np.array([0.125, 0.0, -0.082]), np.array([0.0, 0.0, -0.34])
BINDING_M, SOLE_M = 0.25, 0.085
AIRBORNE_S = (1.8, 2.2)
GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class Athlete:
    """A person, what the person rides, and where both are.

    Attributes:
        body: of the person.
        equipment: as its user would describe it, rightly.
        times: (T) [s].
        poses: (T, S, 4, 4) of the body's segments.
        equipment_poses: (T, E, 4, 4) of the equipment's, in its order.
    """

    body: BodyModel
    equipment: Equipment
    times: Array
    poses: Array
    equipment_poses: Array


def cyclist(duration_s: float = 4.0, cadence_rpm: float = 80.0) -> Athlete:
    """Turns the crank of a bicycle on a roller, sways by 2 mm on the saddle, and holds the bar."""
    times = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    angle = 2.0 * np.pi * cadence_rpm / 60.0 * times
    world_T_frame = rigid(about("z", 0.4), np.array([1.0, -0.5, 0.29]))
    sway = 0.002 * np.stack([np.sin(angle), np.cos(2.0 * angle), np.sin(0.5 * angle)], axis=-1)
    pelvis = world_T_frame @ rigid(about("y", 0.35) @ about("x", 0.03 * np.sin(angle)), [-0.2, 0.0, 0.73] + sway)
    torso = pelvis[:, :3, :3] @ about("y", 0.5 + 0.02 * np.cos(angle))
    frame = np.broadcast_to(world_T_frame, pelvis.shape)
    crank = frame @ rigid(about("y", angle), np.zeros(3))
    pedals, feet, grips = {}, {}, {}
    for side, left, phase in (("left", 1.0, 0.0), ("right", -1.0, np.pi)):
        spindle = (crank @ [left * CRANK_M, left * 0.125, 0.0, 1.0])[:, :3]
        turn = frame[:, :3, :3] @ about("y", 0.15 + 0.25 * np.sin(angle + phase))
        pedals[side] = rigid(turn, spindle)
        feet[side] = rigid(turn, spindle - turn @ BALL_OF_FOOT)
        grips[side] = (frame @ [0.5, 0.2 * left, 0.78, 1.0])[:, :3]
    poses = person(pelvis, torso, feet, grips)
    ours = np.stack([frame, crank, pedals["left"], pedals["right"]], axis=1)
    return Athlete(BODY, bicycle(), times, poses, ours)


def bicycle() -> Equipment:
    """Four segments, a hinge for the crank and one for each pedal, and seven points where the person holds it."""
    y = np.array([0.0, 1.0, 0.0])
    joints = [Joint("crank_axle", "frame", "crank", "hinge", np.eye(4), axis=y)]
    attachments = []
    for side, left in (("left", 1.0), ("right", -1.0)):
        spindle = rigid(np.eye(3), np.array([left * CRANK_M, 0.125 * left, 0.0]))
        joints.append(Joint(f"spindle_{side}", "crank", f"pedal_{side}", "hinge", spindle, axis=y))
        on_pedal = np.array([[0.0, 0.0, 0.0], [0.0, 0.04 * left, 0.0], [0.04, 0.0, 0.0]])
        foot = Attachment(
            f"on_pedal_{side}", f"foot_{side}", f"pedal_{side}", BALL_OF_FOOT + on_pedal, on_pedal, np.full(3, 0.003)
        )
        grip = np.array([[0.5, 0.2 * left, 0.78]])
        hand = Attachment(f"on_bar_{side}", f"forearm_{side}", "frame", GRIP[None], grip, np.array([0.01]))
        attachments += [foot, hand]
    bottom = np.array([-0.02, 0.0, -0.09])
    seat = np.array([-0.2, 0.0, 0.73]) + about("y", 0.35) @ bottom
    attachments.append(Attachment("saddle", "pelvis", "frame", bottom[None], seat[None], np.array([0.01])))
    segments = {
        "frame": SegmentMotion(stands=True),
        "crank": SegmentMotion(keeps_speed=True),
        "pedal_left": SegmentMotion(),
        "pedal_right": SegmentMotion(),
    }
    return Equipment("bicycle", "frame", segments, tuple(joints), tuple(attachments))


def snowboarder(duration_s: float = 4.0) -> Athlete:
    """Rides, crouches, jumps, turns by 180 degrees in the air, and lands in a crouch (B 4.2)."""
    times = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    off, on = AIRBORNE_S
    middle = 0.5 * (off + on)
    speed = 0.5 * GRAVITY * (on - off)
    since = np.clip(times - off, 0.0, on - off)
    height = speed * since - 0.5 * GRAVITY * since**2
    # Half a turn, fastest in the air.
    yaw = CubicHermiteSpline([off - 0.15, middle, on + 0.15], [0.0, 0.5 * np.pi, np.pi], [0.0, 7.0, 0.0])(
        np.clip(times, off - 0.15, on + 0.15)
    )
    lean = 0.15 * np.sin(1.7 * times)
    path = np.stack([3.0 * times, 0.3 * np.sin(1.7 * times), 0.03 + height], axis=-1)
    board = rigid(about("z", yaw) @ about("x", lean), path)
    knots = [(0.0, 0.82), (1.0, 0.8), (1.5, 0.6), (off, 0.86), (middle, 0.64), (on, 0.8), (on + 0.2, 0.56), (3.2, 0.8)]
    above = PchipInterpolator(*zip(*knots, strict=True), extrapolate=True)(np.minimum(times, 3.2))
    # The rider looks across the board.
    turn = about("z", yaw + 0.5 * np.pi + 0.3 * np.sin(2.3 * times)) @ about("y", 0.25)
    pelvis = rigid(turn, path + np.stack([0.0 * above, -0.3 * np.sin(lean), above], axis=-1))
    torso = turn @ about("y", 0.3) @ about("z", 0.3 * np.sin(2.9 * times))
    feet = {side: board @ binding(side) for side in ("left", "right")}
    wave = 0.1 * np.sin(4.0 * times)[:, None] * np.array([1.0, 0.0, 1.0])
    hands = {
        side: pelvis[:, :3, 3] + (turn @ (np.array([0.15, left * 0.5, 0.3]) + wave)[..., None])[..., 0]
        for side, left in (("left", 1.0), ("right", -1.0))
    }
    return Athlete(BODY, snowboard(), times, person(pelvis, torso, feet, hands), board[:, None])


def binding(side: str) -> Array:
    """board_T_foot (4, 4): across the board, toes a little outward; left in front where the board's x points back."""
    left = 1.0 if side == "left" else -1.0
    return rigid(about("z", 0.5 * np.pi + 0.2 * left), np.array([-left * BINDING_M, 0.0, SOLE_M + 0.02]))


def snowboard() -> Equipment:
    """A board with two bindings of four points each."""
    sole = np.array([[0.18, 0.04, -SOLE_M], [0.18, -0.04, -SOLE_M], [-0.05, 0.04, -SOLE_M], [-0.05, -0.04, -SOLE_M]])
    attachments = tuple(
        Attachment(
            f"binding_{side}",
            f"foot_{side}",
            "board",
            sole,
            sole @ binding(side)[:3, :3].T + binding(side)[:3, 3],
            np.full(4, 0.003),
            detected=False,
        )
        for side in ("left", "right")
    )
    return Equipment("snowboard", "board", {"board": SegmentMotion()}, (), attachments)


def lifter(duration_s: float = 4.0) -> Athlete:
    """Squats with a bar on the back, feet on the floor."""
    times = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    down = 0.5 - 0.5 * np.cos(np.pi * times)
    place = np.stack([-0.02 - 0.16 * down, 0.01 * np.sin(2.0 * times), 0.9 - 0.36 * down], axis=-1)
    pelvis = rigid(about("y", 0.05 + 0.45 * down), place)
    torso = pelvis[:, :3, :3] @ about("y", 0.05 + 0.3 * down)
    spine = BODY.joint_to_parent("torso")
    assert spine is not None
    chest = rigid(torso, (pelvis @ np.append(spine.parent_T_joint[:3, 3], 1.0))[:, :3])
    bar = chest @ rigid(np.eye(3), ON_BACK)
    grips = {side: (bar @ [0.0, y, 0.0, 1.0])[:, :3] for side, y in (("left", 0.45), ("right", -0.45))}
    feet = {
        side: np.broadcast_to(rigid(about("z", 0.2 * left), np.array([0.0, 0.17 * left, 0.085])), bar.shape)
        for side, left in (("left", 1.0), ("right", -1.0))
    }
    return Athlete(BODY, barbell(), times, person(pelvis, torso, feet, grips), bar[:, None])


ON_BACK = np.array([-0.09, 0.0, 0.36])


def barbell(apart_m: float = 0.9) -> Equipment:
    """A bar, two hands and a back on it."""
    hands = [
        Attachment(f"grip_{side}", f"forearm_{side}", "bar", GRIP[None], np.array([[0.0, y, 0.0]]), np.array([0.005]))
        for side, y in (("left", 0.5 * apart_m), ("right", -0.5 * apart_m))
    ]
    back = Attachment("on_back", "torso", "bar", ON_BACK[None], np.zeros((1, 3)), np.array([0.01]))
    return Equipment("barbell", "bar", {"bar": SegmentMotion()}, (), (*hands, back))


def about(axis: str, angle: Array | float) -> Array:
    """Rotation (..., 3, 3) by an angle (...) [rad] about x, y or z."""
    return exp_so3(np.asarray(angle)[..., None] * np.eye(3)["xyz".index(axis)])


def person(pelvis: Array, torso: Array, feet: dict[str, Array], hands: dict[str, Array]) -> Array:
    """Poses (T, S, 4, 4) of all segments.

    Args:
        pelvis: (T, 4, 4).
        torso: (T, 3, 3) its rotation in the world; the head looks where the pelvis does, a little less bent.
        feet: side -> poses (T, 4, 4).
        hands: side -> (T, 3) where the grip is.
    """
    offsets = {joint.child: joint.parent_T_joint[:3, 3] for joint in BODY.tree_joints}
    at = {"pelvis": pelvis}

    def place(child: str, parent: str, R: Array) -> None:
        at[child] = rigid(R, (at[parent] @ np.append(offsets[child], 1.0))[:, :3])

    def end(child: str, parent: str) -> Array:
        place: Array = (at[parent] @ np.append(offsets[child], 1.0))[:, :3]
        return place

    place("torso", "pelvis", torso)
    place("head", "torso", torso @ about("y", -0.3))
    forward, backward = at["pelvis"][:, :3, 0], -at["torso"][:, :3, 0] - 0.7 * np.array([0.0, 0.0, 1.0])
    for side in ("left", "right"):
        thigh, shin, foot, upper, lower = (
            f"{name}_{side}" for name in ("thigh", "shin", "foot", "upper_arm", "forearm")
        )
        knees = two_links(end(thigh, "pelvis"), feet[side][:, :3, 3], offsets[shin], offsets[foot], forward)
        place(thigh, "pelvis", knees[0])
        place(shin, thigh, knees[1])
        at[foot] = feet[side]
        arms = two_links(end(upper, "torso"), hands[side], offsets[lower], GRIP, backward, left=-1.0)
        place(upper, "torso", arms[0])
        place(lower, upper, arms[1])
    return np.stack([at[segment] for segment in BODY.segments], axis=1)

"""A solved recording as a robot's: joint states and pose in the world, in a bag of their own."""

import time
from pathlib import Path
from typing import NamedTuple

from bodycam_ros.errors import BodyError
from bodycam_ros.files.yaml_file import read_text
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.body import joint_state_message, transforms_message
from bodycam_ros.messages.diagnostics import text_message
from bodycam_ros.messages.factory import MAP_FRAME
from bodycam_ros.progress import Progress
from bodycam_ros.recording.bag_writer import check_replaceable, write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.results.provenance import Provenance
from bodycam_ros.results.solved_body import read_solved_body
from bodycam_ros.robot.mapping import read_mapping
from bodycam_ros.robot.retargeting import Retargeting, RobotState
from bodycam_ros.robot.robot_model import Robot

_COMMAND = "bodycam export --to robot"
_MAPPING_FILE = "mapping.yaml"


class RobotMotion(NamedTuple):
    """Length of a robot's trajectories over the person's, its states, and the time of inverse kinematics [s]."""

    scale: float
    states: list[RobotState]
    cpu_s: float


def write_robot(
    source: Path,
    urdf: Path,
    mapping_path: Path,
    output: Path,
    force: bool,
    progress: Progress,
) -> RobotMotion:
    """Write the motion of a robot that follows a solved recording.

    Args:
        source: bag that was solved.
        urdf: of the robot.
        mapping_path: its mapping, YAML.
        output: ros2 bag folder to be, with ``/robot_description``, ``/joint_states`` and ``/tf`` of the robot.
        force: replace an earlier output of a robot.
        progress: of messages, then of states.

    Raises:
        RecordingError: the source is no solved bag.
        BodyError: the robot or the mapping cannot be used.
        OutputError: the output cannot be written.
    """
    if output.exists():  # before the work
        check_replaceable(force, output, _COMMAND)
    robot = Robot(urdf, read_mapping(mapping_path))
    solved = read_solved_body(source, progress)
    following = Retargeting(solved.body, robot)
    poses = JointAngles(solved.body).forward_kinematics(solved.world_T_root, solved.joint_angles)
    states = list[RobotState]()
    cpu_s = 0.0
    make = recorded_messages()
    stamps_ns = solved.stamps_ns.tolist()
    with write_recording(output, force, _COMMAND) as writer, progress.step("robot", len(stamps_ns)) as advance:
        Provenance.read(source).copy_to(writer, stamps_ns[0])
        writer.attach(_MAPPING_FILE, "application/yaml", read_text(mapping_path, "mapping", BodyError), stamps_ns[0])
        writer.write("/robot_description", stamps_ns[0], text_message(make, robot.text))
        for stamp_ns, world_T_segment in zip(stamps_ns, poses, strict=True):
            started_s = time.process_time()
            state = following.follow(stamp_ns, world_T_segment)
            cpu_s += time.process_time() - started_s
            joints = joint_state_message(make, stamp_ns, robot.joint_names, state.positions, state.velocities)
            writer.write("/joint_states", stamp_ns, joints)
            root = (MAP_FRAME, robot.tree_root, state.world_T_root)
            writer.write("/tf", stamp_ns, transforms_message(make, stamp_ns, [root]))
            states.append(state)
            advance()
    return RobotMotion(following.scale, states, cpu_s)

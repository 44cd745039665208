"""The parameters of the nodes, each with unit, range and reason. Imports neither ROS nor NumPy."""

from dataclasses import dataclass
from typing import Final

from bodycam_ros.settings import describe, setting

TRACKER_GROUPS: Final = ("keypoints", "direct", "pose_fit", "inertial")
REGISTRATION_GROUPS: Final = ("registrar", "extension", "pose_fit")
SOLVER_GROUPS: Final = (
    *("clock", "assembler", "estimator", "motion", "contact", "evidence"),
    *("coupling", "inertial", "region", "pose_fit"),
)
"""The groups of settings that each node uses."""


@dataclass(frozen=True)
class CommonParameters:
    """Parameters of every node."""

    frame_prefix: str = setting(
        "",
        reason="before the names of all frames but the map's, such as 'anna/', as robot_state_publisher has it: so "
        "several people share one map and one /tf; the node's namespace and a slash if empty, '/' for none",
    )
    moments: str = setting("", reason="output CSV of when each frame arrived and left, for benchmarks.latency")


@dataclass(frozen=True)
class ManagedParameters(CommonParameters):
    """Parameters of every node that can be managed; the player works as long as it lives."""

    autostart: bool = setting(
        True,
        reason="whether the node configures and activates itself, and ends where it cannot; else whoever manages it "
        "does so, with 'ros2 lifecycle set' for one, and a configuration that fails leaves it unconfigured",
    )


@dataclass(frozen=True)
class ImageParameters(ManagedParameters):
    """Parameters of a node that processes images."""

    transport: str = setting(
        "compressed",
        reason="'compressed' reads <camera>/image_raw/compressed, 'raw' <camera>/image_raw, 'video' and "
        "'foxglove' <camera>/image_raw/compressed_video or foxglove; another one is taken if it "
        "alone is published",
    )
    longest_wait: float = setting(
        1.0,
        unit="s",
        limits=(0.0, 600.0),
        reason="when an image has waited for longer the machine does not keep up, and every second one is dropped "
        "until it does again: before 'image_queue' is full; 0: never, where a slow machine is to catch up later",
        live=True,
    )
    image_queue: int = setting(
        60,
        unit="images",
        limits=(1, 10000),
        reason="images of a camera that may wait, 2 s; beyond, the oldest are dropped",
    )


@dataclass(frozen=True)
class TrackerParameters(ImageParameters):
    """Parameters of the node ``tracker``."""

    camera: str = setting("", reason="the camera; its images are on <camera>/image_raw/compressed")
    map: str = setting(
        "",
        reason="folder of the reference map, made by 'bodycam map'; optional: with its photographs the tracker finds "
        "landmarks directly",
    )
    most_ahead: int = setting(
        5,
        unit="frames",
        limits=(1, 10000),
        reason="frames by which the tracker may run ahead of the registration: 0.2 s",
        live=True,
    )
    body: str = setting(
        "", reason="body YAML; with it the camera's inertial sensor, if that was calibrated, predicts its turns"
    )


@dataclass(frozen=True)
class RegistrationParameters(ManagedParameters):
    """Parameters of the node ``registration``."""

    map: str = setting("", reason="folder of the reference map, made by 'bodycam map'")
    body: str = setting("", reason="body YAML, which names the cameras; not needed if 'cameras' is given")
    cameras: tuple[str, ...] = setting(
        (), reason="the cameras to register; those of 'body' if empty; several nodes may share them"
    )
    publish_map: bool = setting(True, reason="of several nodes over one map only one needs to publish map/points")
    landmark_readers: int = setting(
        1,
        limits=(0, 100),
        reason="a camera's first frames wait until so many nodes read its landmarks; the whole graph has two a camera, "
        "tracker and solver",
        live=True,
    )
    landmark_wait: float = setting(
        10.0, unit="s", limits=(0.0, 600.0), reason="go on without them when they are not there by then", live=True
    )
    grown_map: str = setting(
        "",
        reason="output folder, in which each registration stores its grown map under its own name; "
        "after a restart it continues from there; not stored if empty",
    )
    save_interval: float = setting(
        60.0,
        unit="s",
        limits=(1.0, 86400.0),
        reason="how often 'grown_map' is written if it has changed; what was added since is lost by a crash, and the "
        "whole map, some 20 MB, is written each time",
        live=True,
    )


@dataclass(frozen=True)
class SolverParameters(ImageParameters):
    """Parameters of the node ``skeleton_solver``; its images are those of static cameras, in colour."""

    body: str = setting("", reason="body YAML: segments, joints, camera mounts; with 'rig' it is written")
    equipment: str = setting(
        "",
        reason="what the person rides, holds or stands on: a YAML file of it, or the name of a supplied one "
        "such as 'bicycle'",
    )
    cameras: tuple[str, ...] = setting((), reason="the cameras to use; all of the body if empty")
    rig: str = setting(
        "", reason="rig YAML; if given, the node collects a range of motion, and the service ~/calibrate makes the body"
    )
    map: str = setting(
        "",
        reason="with 'rig': folder of the reference map, which must have a scale and a vertical for a body to be made; "
        "with 'stations': the map whose frame is the world",
    )
    stations: str = setting(
        "", reason="YAML of the static cameras, their poses and lenses, whose images are used; none if empty"
    )
    surface: str = setting(
        "",
        reason="with 'stations': folder of the segments' meshes; if empty the one that 'body' names, or capsules along "
        "its bones",
    )
    start: str = setting(
        "", reason="with 'stations': YAML of the body in the first images; if empty body cameras must find it"
    )
    body_cameras: bool = setting(True, reason="whether to use cameras on the body; false for static ones alone")
    publish_links: bool = setting(
        True,
        reason="whether /tf and /tf_static have every link of robot_description, cameras among them; false where "
        "robot_state_publisher publishes them: then /tf has the root alone",
    )
    unobserved_joints: str = setting(
        "predict",
        reason="of a joint that no camera sees /joint_states has: 'predict' what is estimated, 'hold' the angle that "
        "was observed last, with a velocity of NaN, 'omit' nothing",
    )
    mass: float = setting(
        0.0,
        unit="kg",
        limits=(0.0, 1000.0),
        reason="mass of the whole person; robot_description then has inertials, by the table of de Leva 1996; 0: none",
    )
    overwrite_body: bool = setting(False, reason="with 'rig': whether a body that is there already may be replaced")
    facing: float = setting(
        float("nan"),
        unit="deg",
        reason="with 'rig': where the person faces in the N-pose, about the map's z from its x; by hips and shoulders "
        "if it is not given",
    )
    idle_flush: float = setting(
        3.0,
        unit="s",
        limits=(0.1, 600.0),
        reason="without registrations for so long, publish the frames that wait for later ones",
        live=True,
    )


@dataclass(frozen=True)
class RetargetParameters(ManagedParameters):
    """Parameters of the node ``retarget``."""

    urdf: str = setting("", reason="URDF of the robot; its meshes are looked for above it, and in the packages of ROS")
    mapping: str = setting("", reason="YAML of which links of the robot follow what, as config/robot/talos.yaml")
    robot: str = setting("robot", reason="namespace of what is published of the robot, and prefix of its root's frame")


@dataclass(frozen=True)
class PlayerParameters(CommonParameters):
    """Parameters of the node ``player``."""

    bagfile: str = setting("", reason="ros2 bag folder or .mcap file with the cameras")
    imu: str = setting(
        "", reason="ros2 bag with the cameras' inertial sensors, played beside 'bagfile' where that has none"
    )
    cameras: tuple[str, ...] = setting((), reason="the cameras to play; all of the bag if empty")
    prefix: str = setting(
        "",
        reason="namespace of the cameras in the bag, such as /anna of /anna/head/image_raw, which are played in the "
        "node's namespace; if empty the latter, where the bag has cameras in it",
    )
    topics: tuple[str, ...] = setting(
        (),
        reason="topics of the bag with other names: of a camera's images, whose camera_info is beside them, such as "
        "waist_front=/cam0/color/image_raw; of a sensor, waist_front/imu=/cam0/imu",
    )
    rate: float = setting(1.0, limits=(0.001, 1000.0), reason="times the speed at which it was recorded")
    loop: bool = setting(False, reason="start again at the end, with the stamps as recorded: time jumps back")
    clock: float = setting(
        0.0,
        unit="Hz",
        limits=(0.0, 1000.0),
        reason="how often /clock is published, for nodes with use_sim_time; 0: never; rosbag2 has 40",
    )
    readers: int = setting(
        1,
        limits=(0, 100),
        reason="wait for so many nodes that read each camera_info; the whole graph has three a camera",
    )
    reader_wait: float = setting(60.0, unit="s", limits=(0.0, 600.0), reason="give up when they are not there by then")
    image_only: tuple[str, ...] = setting(
        (), reason="cameras whose camera_info is not needed: static ones, whose lens is in a file"
    )
    settle: float = setting(
        1.0, unit="s", limits=(0.0, 60.0), reason="once they are there, give them time to find each other as well"
    )


OF_NODES = {
    "tracker": TrackerParameters,
    "registration": RegistrationParameters,
    "skeleton_solver": SolverParameters,
    "retarget": RetargetParameters,
    "player": PlayerParameters,
}
"""By the name of the executable."""

ALL = tuple(OF_NODES.values())
"""One parameter file serves all nodes, so each must know what is meant for another."""

GROUPS: Final = frozenset(
    """
    images keypoints registrar extension direct pose_fit
    clock assembler estimator motion contact evidence coupling inertial region
    frames features shape
    """.split()
)
"""Groups of settings of all nodes and commands: one file serves all of them."""


def help_text(name: str) -> str:
    """All own parameters of a node, with defaults, as ``ros2 run bodycam_ros NODE --help`` prints them."""
    lines = [f"usage: ros2 run bodycam_ros {name} --ros-args [-p PARAMETER:=VALUE ...] [--params-file FILE]", ""]
    for each in describe(OF_NODES[name]):
        lines += [f"  {each.name} ({each.type.__name__}, {each.default!r})", f"      {each.text()}"]
    return "\n".join([*lines, "", "Settings of the stages, such as registrar.min_inliers: bodycam settings"])

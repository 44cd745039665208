"""The nodes' own parameters, beside the settings of the stages: what to work on, and how to live in a graph."""

from dataclasses import dataclass
from typing import Final

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class TrackerParameters:
    """Of the node ``tracker``."""

    camera: str = setting("", reason="the camera to track; its images are on <camera>/image_raw/compressed")
    transport: str = setting(
        "compressed", reason="'compressed' reads <camera>/image_raw/compressed, 'raw' reads <camera>/image_raw"
    )
    image_queue: int = setting(
        60, unit="images", limits=(1, 10000), reason="how far the tracker may fall behind before images are lost: 2 s"
    )
    most_ahead: int = setting(
        5, unit="frames", limits=(1, 10000), reason="how far the tracker may run ahead of the registration: 0.2 s"
    )


@dataclass(frozen=True)
class RegistrationParameters:
    """Of the node ``registration``."""

    map: str = setting("", reason="folder of the reference map, made by 'bodycam map'")
    body: str = setting("", reason="body YAML, which names the cameras; not needed if 'cameras' is given")
    cameras: tuple[str, ...] = setting(
        (), reason="the cameras to register; those of 'body' if empty; several nodes may share them"
    )


@dataclass(frozen=True)
class SolverParameters:
    """Of the node ``skeleton_solver``."""

    body: str = setting("", reason="body YAML: segments, joints, camera mounts; with 'rig' it is written")
    rig: str = setting(
        "", reason="rig YAML; if given, the node collects a range of motion, and the service ~/calibrate makes the body"
    )
    map: str = setting(
        "",
        reason="with 'rig': folder of the reference map, which must have a scale and a vertical for a body to be made",
    )
    overwrite_body: bool = setting(False, reason="with 'rig': whether a body that is there already may be replaced")
    facing: float = setting(
        float("nan"),
        unit="deg",
        reason="with 'rig': where the person faces in the N-pose, about the map's z from its x; by hips and shoulders "
        "if it is not given",
    )
    info_wait: float = setting(
        10.0,
        unit="s",
        limits=(0.0, 600.0),
        reason="once the first camera_info is here, how long to wait for the other cameras' before going on without",
    )
    idle_flush: float = setting(
        3.0,
        unit="s",
        limits=(0.1, 600.0),
        reason="when no camera was heard for so long, publish the instants that wait for later ones",
    )


@dataclass(frozen=True)
class PlayerParameters:
    """Of the node ``player``."""

    bag: str = setting("", reason="ros2 bag folder or .mcap file with the cameras")
    rate: float = setting(1.0, limits=(0.001, 1000.0), reason="times the speed at which it was recorded")
    readers: int = setting(
        1, limits=(0, 100), reason="wait for so many readers of each camera_info; the whole graph has three a camera"
    )
    reader_wait: float = setting(60.0, unit="s", limits=(0.0, 600.0), reason="give up when they are not there by then")
    settle: float = setting(
        1.0, unit="s", limits=(0.0, 60.0), reason="once they are there, give them time to find each other as well"
    )


ALL: Final = (TrackerParameters, RegistrationParameters, SolverParameters, PlayerParameters)
"""One parameter file serves all nodes, so each must know what is meant for another."""

"""The parameters of the player."""

from dataclasses import dataclass

from bodycam_ros.nodes.common_parameters import CommonParameters
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class PlayerParameters(CommonParameters):
    """Of the node ``player``."""

    bag: str = setting("", reason="ros2 bag folder or .mcap file with the cameras")
    cameras: tuple[str, ...] = setting((), reason="the cameras to play; all of the bag if empty")
    rate: float = setting(1.0, limits=(0.001, 1000.0), reason="times the speed at which it was recorded", live=True)
    loop: bool = setting(
        False, reason="begin again at the end, with the stamps as recorded: time jumps back", live=True
    )
    start_paused: bool = setting(False, reason="play nothing until ~/resume or ~/play_next asks for it")
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
        (), reason="cameras whose camera_info nobody has to read: static ones, whose lens is in a file"
    )
    settle: float = setting(
        1.0, unit="s", limits=(0.0, 60.0), reason="once they are there, give them time to find each other as well"
    )

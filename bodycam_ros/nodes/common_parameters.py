"""The parameters that every node has."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class CommonParameters:
    """Of every node."""

    frame_prefix: str = setting(
        "",
        reason="before the names of all frames but the map's, such as 'anna/', as robot_state_publisher has it: so "
        "several people share one map and one /tf; a namespace alone does not keep their frames apart",
    )
    moments: str = setting(
        "", reason="CSV file to be, of when each frame came and went; 'bodycam latency' tells from it what takes long"
    )


@dataclass(frozen=True)
class ManagedParameters(CommonParameters):
    """Of every node that can be managed; the player works as long as it lives."""

    autostart: bool = setting(
        True,
        reason="whether the node configures and activates itself, and ends where it cannot; else whoever manages it "
        "does so, with 'ros2 lifecycle set' for one, and a configuration that fails leaves it unconfigured",
    )

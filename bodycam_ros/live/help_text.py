"""The parameters of a node as ``ros2 run bodycam_ros NODE --help`` prints them."""

from bodycam_ros.live.node_parameters import OF_NODES
from bodycam_ros.settings import describe


def help_text(name: str) -> str:
    """All own parameters of a node, with defaults, and where its settings are listed."""
    lines = [f"usage: ros2 run bodycam_ros {name} --ros-args [-p PARAMETER:=VALUE ...] [--params-file FILE]", ""]
    for each in describe(OF_NODES[name]):
        lines += [f"  {each.name} ({each.type.__name__}, {each.default!r})", f"      {each.text()}"]
    return "\n".join([*lines, "", "Settings of the stages, such as tracker.keyframe_interval: bodycam settings"])

"""What the launch file starts, by the stand-in of launch."""

from pathlib import Path

from launch_stand_in import Node, performed

REPOSITORY = Path(__file__).parents[1]
LAUNCH_FILE = REPOSITORY / "launch/bodycam.launch.py"


def launched(installed: tuple[str, ...] = (), processes: str = "separate", **arguments: str) -> dict[str, Node]:
    """The nodes by name; on every machine the same, unless ``processes`` is ``auto``."""
    nodes, _ = performed(LAUNCH_FILE, REPOSITORY, installed, processes=processes, **arguments)
    return {node.node_name: node for node in nodes}


def write_rig(folder: Path) -> Path:
    rig = folder / "rig.yaml"
    rig.write_text("cameras: {left: torso, right: arm}\nsegments: {torso: null, arm: torso}\n")
    return rig

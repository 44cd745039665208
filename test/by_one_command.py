"""The live graph by its one command. What it needs of ROS is imported where it is used."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from own_domain import own_domain

from bodycam_ros.nodes.graph import NodeProcess

_REPOSITORY = Path(__file__).parents[1]
_LONGEST_S = 90.0


@dataclass(frozen=True)
class GraphProcess(NodeProcess):
    """All nodes by one command, with flags and not as parameters."""

    flags: tuple[str, ...] = ()

    def arguments(self, config: Path | None = None) -> list[str]:
        return list(self.flags)


def refused(*flags: str) -> list[str]:
    """The lines by which a graph that cannot run says why."""
    command = [sys.executable, "-m", "bodycam_ros.nodes.start", "graph", *flags]
    with own_domain() as domain:
        ours = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        ended = subprocess.run(
            command,
            cwd=_REPOSITORY,
            env=os.environ | ours,
            capture_output=True,
            text=True,
            timeout=_LONGEST_S,
            check=False,
        )
    assert ended.returncode == 1
    # Fast DDS tells of ports that two processes try to open in the same instant.
    said, error = (
        [line for line in text.splitlines() if "RTPS_TRANSPORT_SHM" not in line]
        for text in (ended.stdout, ended.stderr)
    )
    assert not said
    return error

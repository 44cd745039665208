"""Real processes, where ROS is."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[Any]:
    """Processes on a DDS domain of their own."""
    for package in ("rclpy", "bodycam_msgs"):
        pytest.importorskip(package, reason=f"{package} is not installed; 'make test' installs it")
    from helpers.live_graph import running_graph

    with running_graph(tmp_path) as graph:
        yield graph

"""The robot Talos, as the wheel example-robot-data has it; nothing is fetched."""

import sys
from pathlib import Path

import pytest

MAPPING = Path(__file__).parents[2] / "config" / "robot" / "talos.yaml"


def talos_urdf() -> Path:
    """The URDF; skips the test where the wheel is not installed."""
    pytest.importorskip("pink")
    for folder in sys.path:
        share = Path(folder) / "cmeel.prefix" / "share" / "example-robot-data"
        if share.is_dir():
            return share / "robots" / "talos_data" / "robots" / "talos_reduced.urdf"
    pytest.skip("the wheel example-robot-data is not installed")

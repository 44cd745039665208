"""A ride with equipment, in what a body is exported of."""

from pathlib import Path

import pytest
from helpers.known_walk import Walk, write_solved

from bodycam_ros.body.body_file import write_body


@pytest.fixture(params=["ride.yaml", "out"])
def ride_source(request: pytest.FixtureRequest, ride: Walk, tmp_path: Path) -> Path:
    """The body file of a ride, and its solved bag."""
    path = tmp_path / request.param
    if path.suffix:
        write_body(ride.body, path)
    else:
        write_solved(ride, path)
    return path

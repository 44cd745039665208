"""The sample as the view is started on it."""

from pathlib import Path

import pytest


@pytest.fixture
def body_file(sample: Path, tmp_path: Path) -> Path:
    """A copy of the sample's body, to be written to."""
    path = tmp_path / "body.yaml"
    path.write_bytes((sample / "body.yaml").read_bytes())
    return path

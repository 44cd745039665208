"""The sample as the view is started on it."""

import shutil
from pathlib import Path

import pytest

CHROMIUM_NAMES = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of a Chromium on this machine; tests that need one are skipped where there is none."""
    pytest.importorskip("playwright", reason="playwright is not installed: make test installs it")
    found = next((path for name in CHROMIUM_NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("there is no Chromium on this machine: apt-get install chromium")
    return found


@pytest.fixture
def body_file(sample: Path, tmp_path: Path) -> Path:
    """A copy of the sample's body, to be written to."""
    path = tmp_path / "body.yaml"
    path.write_bytes((sample / "body.yaml").read_bytes())
    return path

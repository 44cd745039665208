"""A solved recording of the known walk, and its truth."""

from pathlib import Path

import pytest
from helpers.known_walk import Walk, write_solved, write_truth


@pytest.fixture(scope="session")
def truth(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a recording with the walk's truth."""
    return write_truth(walk, tmp_path_factory.mktemp("truth") / "walk")


@pytest.fixture(scope="session")
def solved(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bag of a perfect solution."""
    return write_solved(walk, tmp_path_factory.mktemp("solved") / "out")

"""The list of a reference folder."""

import os
from pathlib import Path

import pytest
from helpers.naming import naming

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.photographs import find_photographs


@pytest.mark.parametrize("name", [b"hall_\xff.jpg", b"hall_\n.jpg"])
def test_a_photograph_whose_name_cannot_be_written_is_refused_before_the_work(tmp_path: Path, name: bytes) -> None:
    """COLMAP's text has the names; it failed once all was reconstructed."""
    for file in (b"good.jpg", name):
        Path(os.fsdecode(os.path.join(os.fsencode(tmp_path), file))).write_bytes(b"")
    with naming(MapError, repr(os.fsdecode(name))):
        find_photographs(tmp_path)

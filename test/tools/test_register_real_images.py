"""The acceptance on real images, beside COLMAP. Minutes of work: set BODYCAM_SLOW=1 to run it."""

import os

import numpy as np
import pytest
from tools.register_real_images import compare

pytestmark = pytest.mark.skipif(not os.environ.get("BODYCAM_SLOW"), reason="takes minutes; set BODYCAM_SLOW=1")


def test_real_images_are_registered_to_centimetres_in_a_fraction_of_the_time(shared, tmp_path):
    euroc = shared.parent / "real" / "euroc_v101"
    if not euroc.is_dir():
        pytest.skip("the images of EuRoC V1_01 (../shared/real) are not on this machine")
    result = compare(euroc, tmp_path)
    assert len(result.ours.poses) >= 0.95 * result.asked
    assert np.median(result.our_errors) < 0.05
    assert result.ours.seconds < 0.2 * result.colmap.seconds
    assert result.ours.registration_s < 0.2 * result.colmap.registration_s

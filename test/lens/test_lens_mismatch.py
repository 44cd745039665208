from collections import Counter

import numpy as np
import pytest

from bodycam_ros.lens.lens_check import find_mismatches
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording

_FRAMES = 120


@pytest.mark.long
def test_a_camera_with_the_lens_of_another_mode_is_named(sample, tmp_path):
    kinds = ("camera_info", "image_raw/compressed")
    topics = [f"/{camera}/{kind}" for camera in ("shin_left", "thigh_left") for kind in kinds]
    counts = Counter()
    with BagFile(sample / "rom" / "bag") as bag, write_recording(tmp_path / "bag") as writer:
        for topic, stamp_ns, message in bag.messages(topics):
            counts[topic] += 1
            if counts[topic] > _FRAMES:
                continue
            if topic == "/shin_left/camera_info":
                message.k = np.array(message.k) * np.array([0.75, 1, 1, 1, 0.75, 1, 1, 1, 1])
            writer.write(topic, stamp_ns, message)
    (match,) = find_mismatches(tmp_path / "bag", ["shin_left", "thigh_left"])
    line = match.text
    assert "camera shin_left: images do not fit its calibration (camera_info)" in line
    assert "1.33 times as long" in line

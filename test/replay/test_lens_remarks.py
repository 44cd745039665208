from collections import Counter

import numpy as np

from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.replay.lens_remarks import doubted_cameras, lens_remarks
from bodycam_ros.replay.replay_summary import ReplaySummary
from bodycam_ros.verdict.verdict import Finding, Level, Verdict

_FRAMES = 120


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
    (line,) = lens_remarks(tmp_path / "bag", ["shin_left", "thigh_left"])
    assert "camera shin_left: was not recorded with its lens" in line
    assert "1.33 times as long" in line


def test_cameras_are_looked_at_that_were_lost_or_contradict():
    summary = ReplaySummary(recorded_s=1.0)
    summary.images = Counter(head=100, shin=100, thigh=100)
    summary.registered = Counter(head=98, shin=20, thigh=97)
    summary.verdict = Verdict.of([Finding("thigh", Level.WRONG, "is elsewhere")])
    assert doubted_cameras(summary) == ("shin", "thigh")

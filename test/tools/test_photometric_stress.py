"""The stress does what it says to the light, and nothing to anything else."""

from pathlib import Path

import cv2
import numpy as np
from tiny_bag import CAMERAS, write_tiny_bag
from tools.photometric_stress import GAIN, GAMMA, IMAGES, SHADOW, Light, stress_bag

from bodycam_ros.recording.bag_file import BagFile

_INFO = "/camera_info"


def _messages(bag: Path, ending: str) -> list[tuple[str, int, int, bytes]]:
    with BagFile(bag) as file:
        return [
            (topic, recorded_ns, message.header.stamp.nanosec, bytes(message.data if ending == IMAGES else message.k))
            for topic, recorded_ns, message in file.messages([f"/{camera}{ending}" for camera in CAMERAS])
        ]


def test_only_pixels_change_and_a_seed_gives_the_same_again(tmp_path: Path) -> None:
    source = write_tiny_bag(tmp_path / "bag")
    stress_bag(source, tmp_path / "one", seed=3)
    stress_bag(source, tmp_path / "same", seed=3)
    stress_bag(source, tmp_path / "other", seed=4)
    before, one = _messages(source, IMAGES), _messages(tmp_path / "one", IMAGES)
    assert [message[:3] for message in one] == [message[:3] for message in before]
    assert all(new[3] != old[3] for new, old in zip(one, before, strict=True))
    assert one == _messages(tmp_path / "same", IMAGES)
    assert one != _messages(tmp_path / "other", IMAGES)
    assert _messages(tmp_path / "one", _INFO) == _messages(source, _INFO) != []


def test_gamma_gain_and_half_a_shadow_are_in_the_pixels() -> None:
    lights = [Light.of_camera(f"camera_{number}", seed=1) for number in range(40)]
    assert all(GAMMA[0] <= light.gamma <= GAMMA[1] for light in lights)
    assert min(light.gamma for light in lights) < 0.8 < 1.3 < max(light.gamma for light in lights)
    assert {light.sweep_s > 0.0 for light in lights} == {True, False}
    grey = np.full((120, 160, 3), 100, np.uint8)
    seen = []
    for light in lights:
        for seconds in np.linspace(0.0, light.ramp_s, 7):
            gain = light.gain(seconds)
            seen.append(gain)
            image = light.on(grey, seconds)
            bright = min(255.0, 255.0 * (100 / 255) ** light.gamma * gain)
            assert abs(float(image.max()) - bright) <= 1.0
            assert abs(float(image.min()) - SHADOW * 255.0 * (100 / 255) ** light.gamma * gain) <= 1.0
            dark_share = float((image[..., 0] < 0.725 * image.max()).mean())
            assert 0.1 < dark_share < 0.9
            if not light.sweep_s:
                assert abs(dark_share - 0.5) < 0.03
    assert GAIN[0] <= min(seen) < 0.8 and 1.3 < max(seen) <= GAIN[1]


def test_a_moving_border_moves() -> None:
    light = next(a for n in range(40) if (a := Light.of_camera(str(n), 0)).sweep_s)
    first, later = (light.shadow(48, 64, part * light.sweep_s) for part in (0.25, 0.75))
    assert abs(float(first.mean() - later.mean())) > 0.1
    assert cv2.minMaxLoc(first)[0] >= SHADOW - 1e-6

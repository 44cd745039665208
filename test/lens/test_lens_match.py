import cv2
import numpy as np
import pytest
from helpers.known_lenses import LENSES

from bodycam_ros.camera import camera_from_info
from bodycam_ros.geometry import exp_so3
from bodycam_ros.lens.lens_check import match_images, match_lens
from bodycam_ros.lens.lens_fit import lens_numbers, with_lens


def _scaled(camera, scale):
    lens = lens_numbers(camera)
    lens[:2] *= scale
    return with_lens(camera, lens)


def _pairs(camera, turn_deg=15.0, count=6, outliers=0.2, noise_px=0.3):
    """Points of a room seen before and after turning and going on; some of them are on the wearer, and move."""
    random = np.random.default_rng(4)
    pairs = []
    for _ in range(count):
        points = random.uniform(-3.0, 3.0, (900, 3))
        points = points[np.linalg.norm(points, axis=1) > 0.8]
        axis = random.normal(size=3)
        turn = exp_so3(np.radians(turn_deg) * axis / np.linalg.norm(axis))
        after = (points - random.normal(0.0, 0.06, 3)) @ turn.T
        moving = random.random(len(points)) < outliers
        after[moving] += random.normal(0.0, 0.2, (int(moving.sum()), 3))
        (first, valid), (second, also) = camera.project(points), camera.project(after)
        seen = valid & also & camera.in_image(first) & camera.in_image(second)
        pair = [
            pixels[seen][:250] + random.normal(0.0, noise_px, pixels[seen][:250].shape) for pixels in (first, second)
        ]
        pairs.append((pair[0], pair[1]))
    return pairs


@pytest.mark.parametrize("model", ["equidistant", "plumb_bob"])
def test_the_lens_that_took_the_pictures_fits(model):
    match = match_lens(LENSES[model], _pairs(LENSES[model]))
    assert match.pairs >= 4
    assert match.matches
    assert match.error_px < 1.0


# A narrow view that is narrower still tells little of its lens.
@pytest.mark.parametrize(
    ("model", "scale", "mode"),
    [("equidistant", 1.35, "linear"), ("equidistant", 0.75, "wide"), ("plumb_bob", 0.75, "wide")],
)
def test_the_mode_of_another_lens_is_named(model, scale, mode):
    recorded_with = _scaled(LENSES[model], scale)
    match = match_lens(LENSES[model], _pairs(recorded_with))
    assert match.scale == pytest.approx(scale, rel=0.06)
    assert match.best_px < 0.75 * match.error_px
    assert mode in match.text


def _shifting_plane(seed):
    """Images (240, 320) of a texture that shifts by whole pixels, as of a wall that is filmed sideways."""
    cells = np.random.default_rng(seed).integers(30, 230, (120, 280), np.uint8)
    texture = cv2.resize(cells, None, fx=4, fy=4, interpolation=cv2.INTER_CUBIC)
    return [np.ascontiguousarray(texture[:240, 6 * k : 6 * k + 320]) for k in range(40)]


@pytest.mark.parametrize("seed", [0, 1])
def test_a_plane_that_shifts_tells_nothing_of_the_lens(seed):
    """It errs by hundredths of a pixel whatever the focal length; it was told to have half of it."""
    camera = camera_from_info("head", 320, 240, "plumb_bob", [0.0] * 5, [200, 0, 160, 0, 200, 120, 0, 0, 1])
    match = match_images(camera, _shifting_plane(seed))
    assert match.pairs >= 4
    assert match.matches

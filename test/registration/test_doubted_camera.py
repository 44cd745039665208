"""A camera that is doubted while it is tracked directly, by the photographs of the sample's map."""

from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.camera_pipeline import CameraPipeline
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.doubted_place import DoubtSettings
from bodycam_ros.registration.reference_map import ReferenceMap

CAMERA, DOUBTED = "shin_left", 6
LASTING_S = 0.3


@pytest.mark.parametrize("stronger", [100.0, 1.5])
def test_it_lets_go_of_its_landmarks_and_comes_back(sample: Path, stronger: float) -> None:
    """After the doubt is over, or before by stronger evidence, which is there: the body was wrong; then for good."""
    settings = PipelineSettings(doubt=DoubtSettings(lasting=LASTING_S, stronger=stronger))
    with open_recording(sample / "sample" / "bag") as recording:
        camera = recording.camera_model(CAMERA)
        images = [image for image, _ in zip(recording.images([CAMERA]), range(24), strict=False)]
    pipeline = CameraPipeline(camera, ReferenceMap.load(sample / "map"), settings)
    said = []
    for number, image in enumerate(images):
        said.append(pipeline.process(decode_grey(image), image.stamp_ns)[1])
        if number == DOUBTED:
            pipeline.doubt(image.stamp_ns)
    registered = np.array([matches.world_T_camera is not None for matches in said])
    seconds = 1e-9 * np.array([matches.stamp_ns - said[DOUBTED].stamp_ns for matches in said])
    assert registered[: DOUBTED + 1].all() and not registered[DOUBTED + 1]
    # Nothing of the place in doubt is carried on: a name would lead there again.
    assert len(said[DOUBTED + 2].landmark_ids) == 0 or registered[DOUBTED + 2]
    back = DOUBTED + 1 + int(np.argmax(registered[DOUBTED + 1 :]))
    assert registered[back:].all()
    assert (seconds[back] < LASTING_S) == (stronger < 100.0)

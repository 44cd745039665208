"""What is reported of the registrations of cameras."""

import numpy as np
from helpers.registered_pose import registered_pose

from bodycam_ros.diagnostics.camera_diagnostics import RegistrationDiagnostics
from bodycam_ros.messages.diagnostics import StatusLevel


def test_a_camera_with_few_images_is_a_warning_and_one_without_an_error() -> None:
    diagnostics = RegistrationDiagnostics(["chest", "foot", "hand", "head"])
    for camera, images in {"chest": 30, "foot": 5, "head": 30}.items():
        for number in range(images):
            diagnostics.add(registered_pose(camera, number + 1, number, np.eye(4)))
    levels = {status.name: status.level for status in diagnostics.report()}
    assert levels == {
        "camera chest": StatusLevel.OK,
        "camera foot": StatusLevel.WARN,
        "camera hand": StatusLevel.ERROR,
        "camera head": StatusLevel.OK,
    }

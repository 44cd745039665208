"""Inertial sensors of a recording, as cameras on a body use them."""

from collections.abc import Mapping

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.files.shown import few
from bodycam_ros.inertial.camera_turn import CameraTurn
from bodycam_ros.inertial.imu_samples import ImuSamples


def camera_turns(body: BodyModel, imus: Mapping[str, ImuSamples]) -> dict[str, CameraTurn]:
    """Camera -> its turns, of cameras whose sensor is calibrated and has samples."""
    calibrations = {camera: mount.imu for camera, mount in body.mounts.items()}
    return {
        camera: CameraTurn(calibration, samples)
        for camera, samples in imus.items()
        if (calibration := calibrations.get(camera)) is not None and len(samples)
    }


def unused_sensors(body: BodyModel, imus: Mapping[str, ImuSamples]) -> list[str]:
    """A remark on inertial sensors that have samples and are not used, and on those that have none that can be."""
    on_body = {camera: body.mounts[camera].imu for camera in imus if camera in body.mounts}
    uncalibrated = [camera for camera, calibration in sorted(on_body.items()) if calibration is None]
    remarks = []
    if uncalibrated:
        remarks.append(
            f"inertial sensors of {few(uncalibrated)} are not used: body {body.name} has no calibration of them; "
            "make it of a range of motion with their samples ('bodycam body')"
        )
    for camera in sorted(on_body.keys() - {*uncalibrated}):
        if not len(imus[camera]):
            reason = imus[camera].left_out or "there are none"
            remarks.append(f"camera {camera}: its inertial sensor has no usable samples ({reason}); it is not used")
    return remarks

import io

import numpy as np
import pinocchio
import pytest
import yourdfpy
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.kinematics.joint_angles import JointAngles


def frames_in_root(body: BodyModel, angles: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Link -> pose in the root, by our own forward kinematics."""
    poses = body.forward_kinematics(np.eye(4), JointAngles(body).poses(angles))
    links = dict(zip(body.segments, poses, strict=True))
    for camera, mount in body.mounts.items():
        links[optical_frame(camera)] = links[mount.segment] @ mount.segment_T_camera
    return links


def random_angles(body: BodyModel) -> NDArray[np.float64]:
    """Beyond pi too, as continuous angles may be."""
    return np.random.default_rng(8).uniform(-6.0, 6.0, size=(20, len(JointAngles(body).names)))


def test_yourdfpy_agrees_with_our_forward_kinematics(body: BodyModel) -> None:
    model = yourdfpy.URDF.load(io.BytesIO(urdf_text(body).encode()), load_meshes=False, build_scene_graph=True)
    assert model.validate()
    assert model.base_link == "pelvis"
    assert tuple(model.actuated_joint_names) == JointAngles(body).names
    for angles in random_angles(body):
        model.update_cfg(dict(zip(JointAngles(body).names, angles, strict=True)))
        for link, pose in frames_in_root(body, angles).items():
            np.testing.assert_allclose(model.get_transform(link), pose, atol=1e-9)


def test_pinocchio_agrees_with_our_forward_kinematics(body: BodyModel) -> None:
    model = pinocchio.buildModelFromXML(urdf_text(body))
    data = model.createData()
    for angles in random_angles(body):
        q = pinocchio.neutral(model)
        for name, angle in zip(JointAngles(body).names, angles, strict=True):
            joint = model.joints[model.getJointId(name)]
            # Pinocchio keeps a joint without limits as cosine and sine.
            q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        pinocchio.framesForwardKinematics(model, data, q)
        for link, pose in frames_in_root(body, angles).items():
            np.testing.assert_allclose(data.oMf[model.getFrameId(link)].homogeneous, pose, atol=1e-9)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9])
def test_a_camera_at_the_singularity_of_roll_pitch_yaw_keeps_its_place(pitch: float) -> None:
    segment_T_camera = np.eye(4)
    segment_T_camera[:3, :3] = Rotation.from_euler("xyz", [0.3, pitch, 0.8]).as_matrix()
    body = BodyModel("b", "root", ("root",), (), {"cam": CameraMount("root", segment_T_camera)})
    model = yourdfpy.URDF.load(io.BytesIO(urdf_text(body).encode()), load_meshes=False, build_scene_graph=True)
    np.testing.assert_allclose(model.get_transform("cam_optical_frame"), segment_T_camera, atol=1e-9)

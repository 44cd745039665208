from pathlib import Path

import numpy as np
import pytest
import trimesh

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.surface import OPEN, edges_of
from bodycam_ros.geometry import rigid
from bodycam_ros.kinematics.joint import Joint


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return read_body(sample / "body.yaml")


def joint(name: str, parent: str, child: str, at: tuple[float, float, float]) -> Joint:
    return Joint(name, parent, child, "ball", rigid(np.eye(3), np.array(at)))


def test_every_segment_of_a_person_has_a_closed_surface(body: BodyModel) -> None:
    surfaces = capsule_surfaces(body)
    assert tuple(surfaces) == body.segments
    for surface in surfaces.values():
        assert (edges_of(surface.faces)[1] != OPEN).all()
        for part in trimesh.Trimesh(surface.vertices, surface.faces, process=False).split():
            assert part.volume > 0.0


def test_the_body_weighs_what_a_person_does(body: BodyModel) -> None:
    """Hands aside, and the density of the body that of water; parts overlap at the joints and within the trunk."""
    volumes = [
        trimesh.boolean.union(trimesh.Trimesh(s.vertices, s.faces, process=False).split(), engine="manifold").volume
        for s in capsule_surfaces(body).values()
    ]
    assert 60.0 < 1000.0 * sum(volumes) < 100.0  # litres; of 1.74 m, 73 kg is usual

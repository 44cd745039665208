"""Which body it is: what its file describes counts, not how it is written."""

from dataclasses import replace
from pathlib import Path

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_identity import body_identity
from bodycam_ros.body.body_yaml import body_from_yaml, yaml_text
from bodycam_ros.body.urdf import urdf_text


def test_layout_and_report_do_not_count(sample: Path, tmp_path: Path) -> None:
    body = read_body(sample / "body.yaml")
    identity = body_identity(body)
    write_body(replace(body, report={"corrections": ["one"]}), tmp_path / "again.yaml")
    (tmp_path / "again.yaml").write_text(f"# noted\n{(tmp_path / 'again.yaml').read_text()}")
    (tmp_path / "body.urdf").write_text(urdf_text(body))
    assert body_identity(read_body(tmp_path / "again.yaml")) == identity
    assert body_identity(read_body(tmp_path / "body.urdf")) == identity
    assert body_identity(body_from_yaml(yaml_text(body))) == identity


def test_a_mount_that_is_moved_makes_another_body(sample: Path) -> None:
    body = read_body(sample / "body.yaml")
    camera, mount = next(iter(body.mounts.items()))
    moved = mount.segment_T_camera.copy()
    moved[0, 3] += 1e-3
    other = replace(body, mounts={**body.mounts, camera: replace(mount, segment_T_camera=moved)})
    assert body_identity(other) != body_identity(body)

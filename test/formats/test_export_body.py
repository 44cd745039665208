"""bodycam export, through the command line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
import yourdfpy
from helpers.known_walk import Walk, write_solved

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.cli.main import main
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.messages.diagnostics import text_message
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages


def test_a_body_becomes_a_urdf_that_is_the_same_body(sample: Path, tmp_path: Path) -> None:
    output = tmp_path / "body.urdf"
    assert main(["export", str(sample / "body.yaml"), "--to", "urdf", "-o", str(output)]) == 0
    assert [file.name for file in tmp_path.iterdir()] == ["body.urdf"]
    body = read_body(sample / "body.yaml")
    assert output.read_text() == urdf_text(body)
    assert set(body.segments) < set(yourdfpy.URDF.load(str(output), load_meshes=False).link_map)
    assert read_body(output).segments == body.segments


@pytest.mark.parametrize("source", ["ride.yaml", "out"])
def test_a_mass_gives_the_person_inertials_and_the_equipment_none(ride: Walk, tmp_path: Path, source: str) -> None:
    write_body(ride.body, tmp_path / "ride.yaml")
    write_solved(ride, tmp_path / "out")
    arguments = ["export", str(tmp_path / source), "--to", "urdf", "--mass", "70", "-o", str(tmp_path / "body.urdf")]
    assert main(arguments) == 0
    links = yourdfpy.URDF.load(str(tmp_path / "body.urdf"), load_meshes=False).link_map
    masses = {name: link.inertial.mass for name, link in links.items() if link.inertial is not None}
    assert sum(masses.values()) == pytest.approx(70.0)
    assert set(masses) == set(ride.body.segments) - ride.body.equipment_segments


def test_a_solved_bag_gives_the_body_that_it_published_last(tmp_path: Path, sample: Path) -> None:
    body = read_body(sample / "body.yaml")
    early, late = (urdf_text(replace(body, name=name)) for name in ("early", "late"))
    with write_recording(tmp_path / "out") as writer:
        for text in (early, late):
            writer.write("/robot_description", 1, text_message(recorded_messages(), text))
    output = tmp_path / "body.urdf"
    for source in (tmp_path / "out", next((tmp_path / "out").glob("*.mcap"))):
        assert main(["export", str(source), "--to", "urdf", "-o", str(output)]) == 0
        assert output.read_text() == late
        output.unlink()


def test_what_urdf_cannot_carry_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    joints = (
        Joint("crank", "frame", "pedal", "hinge", np.eye(4), sigmas=(1.0,) * 6),
        Joint("foot", "frame", "pedal", "ball", np.eye(4), sigmas=(2.0,) * 6),
    )
    write_body(BodyModel("bike", "frame", ("frame", "pedal"), joints, {}), tmp_path / "bike.yaml")
    assert main(["export", str(tmp_path / "bike.yaml"), "--to", "urdf", "-o", str(tmp_path / "bike.urdf")]) == 0
    assert [record.getMessage().split(": ")[1] for record in caplog.records] == [
        "joints crank have sigmas of their own, which other programs do not read from a URDF",
        "joints foot close loops; a URDF is a tree and leaves them open",
    ]


def test_loops_are_in_the_urdf_for_those_who_read_them(ride: Walk, ride_source: Path, tmp_path: Path) -> None:
    output = tmp_path / "body.urdf"
    assert main(["export", str(ride_source), "--to", "urdf", "-o", str(output)]) == 0
    (loop,) = read_body(output).loop_joints
    write_body(ride.body, tmp_path / "ride.yaml")
    given = yaml.safe_load((tmp_path / "ride.yaml").read_text())["joints"]["pedal_left"]
    assert loop.name == "pedal_left" and given["sigmas"] == list(loop.sigmas or ())
    assert set(ride.body.segments) < set(yourdfpy.URDF.load(str(output), load_meshes=False).link_map)


@pytest.mark.parametrize(
    ("source", "complaint"),
    [
        ("nobody.yaml", "nobody.yaml: cannot read this body file"),
        ("map.yaml", "map.yaml: a body file: table "),
        ("tiny", "tiny: nothing on /robot_description (std_msgs/msg/String); expected a bag that 'bodycam replay'"),
        ("folder", "folder: "),
    ],
)
def test_what_cannot_be_exported_is_one_line_and_leaves_no_file(
    tiny_bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], source: str, complaint: str
) -> None:
    assert tiny_bag == tmp_path / "tiny"
    (tmp_path / "map.yaml").write_text("format: 1\n")
    (tmp_path / "folder").mkdir()
    output = tmp_path / "body.urdf"
    assert main(["export", str(tmp_path / source), "--to", "urdf", "-o", str(output)]) == 1
    said = capsys.readouterr().err
    assert said.startswith("bodycam: error: ") and complaint in said and said.count("\n") == 1
    assert not list(tmp_path.glob("*body.urdf*"))


def test_the_folder_of_an_output_is_made(sample: Path, tmp_path: Path) -> None:
    output = tmp_path / "new" / "folder" / "body.urdf"
    assert main(["export", str(sample / "body.yaml"), "--to", "urdf", "-o", str(output)]) == 0
    assert [path.name for path in output.parent.iterdir()] == ["body.urdf"]


def test_an_output_that_cannot_be_written_is_named(
    sample: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("mine")
    output = tmp_path / "file" / "body.urdf"
    assert main(["export", str(sample / "body.yaml"), "--to", "urdf", "-o", str(output)]) == 1
    assert f"{output}: cannot be written: " in capsys.readouterr().err

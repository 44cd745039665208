"""Exports of motion that is incomplete, and orders that cannot be obeyed."""

import re
from itertools import pairwise
from pathlib import Path

import ezc3d
import numpy as np
import pybvh
import pytest
from helpers.exported_files import Exported
from helpers.known_walk import FRAME_NS, START_NS, Walk, write_solved

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.cli.main import main
from bodycam_ros.formats.export import FORMATS
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.messages.body import equipment_message
from bodycam_ros.messages.factory import Message
from bodycam_ros.recording.typestore import recorded_messages

GAP = slice(20, 30)
MOTION = [name for name, form in FORMATS.items() if "rate" in form.options]


@pytest.fixture(scope="module")
def gappy(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    folder = tmp_path_factory.mktemp("gappy")
    return Exported.of(write_solved(walk.without(list(range(60)[GAP])), folder / "out"), folder)


def test_what_can_be_left_empty_in_a_gap_is(gappy: Exported) -> None:
    points = ezc3d.c3d(str(gappy.file("c3d")))["data"]["points"]
    table = np.genfromtxt(gappy.file("csv", "--rate", "30.00000003"), delimiter=",", names=True)
    with np.load(gappy.file("npz", "--rate", "30.00000003")) as arrays:
        known = arrays["known"]
    way = np.loadtxt(gappy.file("tum", "--rate", "30.00000003"))
    inside = np.zeros(60, bool)
    inside[GAP] = True
    np.testing.assert_array_equal(np.isnan(points[:3]).all(axis=(0, 1)), inside)
    np.testing.assert_array_equal(np.isnan(table["knee_left_deg"]), inside)
    assert np.isfinite(table["time_s"]).all()
    np.testing.assert_array_equal(~known, np.repeat(inside[:, None], known.shape[1], axis=1))
    assert len(way) == 50


def test_what_cannot_goes_straight_across(gappy: Exported, walk: Walk) -> None:
    in_bvh = pybvh.read_bvh_file(gappy.file("bvh")).root_pos
    in_trc = np.loadtxt(gappy.file("trc"), skiprows=6)[:, 2:5] / 1000.0  # the first marker is at the root
    in_mot = np.loadtxt(gappy.file("mot"), skiprows=7)[:, 4:7]
    for positions in (in_bvh, in_trc, in_mot):
        assert len(positions) == 60
        before, after = positions[19], positions[30]
        share = (np.arange(20, 30) - 19)[:, None] / 11.0
        np.testing.assert_allclose(positions[GAP], before + share * (after - before), atol=1e-5)


def unplaced(row: int, stamp_ns: int) -> tuple[str, int, Message]:
    """What the solver says of a bicycle that it finds at the tenth instant."""
    nothing = np.zeros(0)
    report = EquipmentReport("bicycle", row >= 10, (), np.zeros(0, bool), nothing, (), nothing, nothing, nothing)
    return "/equipment", stamp_ns, equipment_message(recorded_messages(), stamp_ns, report)


def test_equipment_is_no_bone_and_is_in_tables_where_it_was_known(
    ride: Walk, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    more = [unplaced(row, stamp_ns) for row, stamp_ns in enumerate(ride.stamps_ns.tolist())]
    exported = Exported.of(write_solved(ride, tmp_path / "out", more=more), tmp_path)
    table = np.genfromtxt(exported.file("csv", name="table"), delimiter=",", names=True)
    for column, first in {"crank_x_m": 10, "crank_deg": 10, "knee_left_deg": 0}.items():
        np.testing.assert_array_equal(np.flatnonzero(np.isfinite(table[column])), np.arange(first, 60))
    assert len(np.loadtxt(exported.file("tum", "--segment", "crank"))) == 50
    often = np.loadtxt(exported.file("tum", "--segment", "crank", "--rate", "300", name="often"))[:, 0]
    assert 0.0 <= often[0] - 1e-9 * ride.stamps_ns[10] < 4e-3
    assert not set(pybvh.read_bvh_file(exported.file("bvh")).joint_names) & {"frame", "crank"}
    assert (
        "out: crank, frame, which are no part of the body, are left out; glb, csv, tum, npz, ply, usd have them"
        in caplog.text
    )
    columns = exported.file("csv").read_text().splitlines()[0].split(",")
    assert {"crank_x_m", "bicycle_at_x_m", "crank_deg", "knee_left_deg"} < set(columns)
    assert "crank" not in exported.file("mot").read_text()


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        ("--to bvh --rate 0", "--rate must be above 0 and at most 1000 a second, not 0"),
        ("--to bvh --rate nan", "--rate must be above 0"),
        ("--to bvh --rate 1e9", "--rate must be above 0 and at most 1000"),
        ("--to bvh --rate 1e-9", "{out}: lasts 1.97 s, too short for a second frame"),
        ("--to bvh --scale -1", "--scale must be above 0"),
        ("--to csv --up y", "--up has no effect on csv; bvh, c3d, usd use it"),
        ("--to glb --scale 100", "--scale has no effect on glb; bvh, usd use it"),
        ("--to mjcf --mass 70", "--mass has no effect on mjcf; urdf uses it"),
        ("--to urdf --mass 0", "--mass must be above 0 and at most 1000 kg, not 0"),
        ("--to urdf --rate 30", "--rate has no effect on urdf; bvh, trc"),
        ("--to tum --segment tail", "--segment tail: the body has no such segment or camera; there are pelvis, torso"),
    ],
)
def test_what_cannot_be_obeyed_is_named(
    gappy: Exported, tmp_path: Path, capsys: pytest.CaptureFixture[str], flags: str, complaint: str
) -> None:
    output = tmp_path / "motion"
    assert main(["export", str(gappy.out), *flags.split(), "-o", str(output)]) == 1
    said = capsys.readouterr().err
    assert f"bodycam: error: {complaint.format(out=gappy.out)}" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("flags", ["--to fbx", "--to bvh --names maya", "--to bvh --pose Q", "--to bvh --up x"])
def test_an_unknown_choice_shows_those_that_there_are(
    gappy: Exported, tmp_path: Path, capsys: pytest.CaptureFixture[str], flags: str
) -> None:
    with pytest.raises(SystemExit):
        main(["export", str(gappy.out), *flags.split(), "-o", str(tmp_path / "motion")])
    assert re.search(r"invalid choice: .* \(choose from ", capsys.readouterr().err)


@pytest.mark.parametrize("to", MOTION)
def test_a_body_file_and_a_bag_that_nobody_solved_are_refused(
    sample: Path, tiny_bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], to: str
) -> None:
    output = tmp_path / "motion"
    for source, complaint in (
        (sample / "body.yaml", "body.yaml: has no motion; give a bag that 'bodycam replay' wrote"),
        (tiny_bag, "no topic /robot_description; expected a bag that"),
        (tmp_path / "none", "none"),
    ):
        assert main(["export", str(source), "--to", to, "-o", str(output)]) == 1
        said = capsys.readouterr().err
        assert complaint in said and said.count("\n") == 1
    assert sorted(file.name for file in tmp_path.iterdir()) == ["tiny"]


@pytest.mark.parametrize("missing", ["/joint_states", "/odometry"])
def test_a_bag_without_motion_is_refused(
    walk: Walk, tmp_path: Path, capsys: pytest.CaptureFixture[str], missing: str
) -> None:
    out = write_solved(walk, tmp_path / "out", leave_out=(missing,))
    assert main(["export", str(out), "--to", "bvh", "-o", str(tmp_path / "a.bvh")]) == 1
    assert f"out: no topic {missing};" in capsys.readouterr().err
    alone = write_solved(walk.without(list(range(1, 60))), tmp_path / "alone")
    assert main(["export", str(alone), "--to", "bvh", "-o", str(tmp_path / "a.bvh")]) == 1
    assert "only one frame was solved" in capsys.readouterr().err


@pytest.mark.parametrize("to", MOTION)
def test_what_is_there_is_replaced_only_by_its_like_and_by_force(
    gappy: Exported, tmp_path: Path, capsys: pytest.CaptureFixture[str], to: str
) -> None:
    output = tmp_path / f"motion.{to}"
    arguments = ["export", str(gappy.out), "--to", to, "-o", str(output)]
    assert main(arguments) == 0
    made = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert main(arguments) == 1
    assert f"{output}: exists already" in capsys.readouterr().err
    assert main([*arguments, "--force"]) == 0
    assert made.keys() == {file.name for file in tmp_path.iterdir()}
    output.write_text("ten years of work\n")
    assert main([*arguments, "--force"]) == 1
    assert f"{output}: is no {to}" in capsys.readouterr().err
    assert output.read_text() == "ten years of work\n"


def test_a_model_of_another_body_is_not_replaced_without_force(
    gappy: Exported, ride: Walk, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "walk.osim").write_text("mine\n")
    arguments = ["export", str(gappy.out), "-o"]
    assert main([*arguments, str(tmp_path / "walk.mot"), "--to", "mot"]) == 1
    assert main([*arguments, str(tmp_path / "walk.mot"), "--to", "mot", "--force"]) == 1
    assert "walk.osim: is no OpenSim model" in capsys.readouterr().err
    (tmp_path / "walk.osim").unlink()
    for to in ("mot", "trc"):  # the second finds the model of the first, which is its own
        assert main([*arguments, str(tmp_path / f"walk.{to}"), "--to", to]) == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["walk.mot", "walk.osim", "walk.trc"]


def test_a_recording_given_twice_and_a_file_for_a_folder_are_refused(
    gappy: Exported, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("mine\n")
    source = str(gappy.out)
    assert main(["export", source, source, "--to", "bvh", "-o", str(tmp_path / "all")]) == 1
    assert "the same recording is given twice" in capsys.readouterr().err
    other = str(gappy.out / "out.mcap")
    assert main(["export", source, other, "--to", "bvh", "-o", str(tmp_path / "file")]) == 1
    assert "is a file; several recordings are written into a folder" in capsys.readouterr().err
    assert main(["export", source, "--to", "bvh", "-o", str(tmp_path / "walk.trc")]) == 1
    assert "walk.trc: is named as trc, but would be bvh; give another name, or --to trc" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_a_chain_of_hundreds_of_bones_is_refused_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    segments = tuple(f"s{number}" for number in range(300))
    joints = tuple(Joint(f"j{child}", parent, child, "hinge", np.eye(4)) for parent, child in pairwise(segments))
    snake = BodyModel("snake", "s0", segments, joints, {})
    poses = np.tile(np.eye(4), (2, 300, 1, 1))
    out = write_solved(Walk(snake, START_NS + FRAME_NS * np.arange(2), poses), tmp_path / "out")
    for to in ("bvh", "glb", "usd"):
        assert main(["export", str(out), "--to", to, "-o", str(tmp_path / "snake")]) == 1
        assert "a chain of more than 200 segments is not written as bones" in capsys.readouterr().err
    assert main(["export", str(out), "--to", "trc", "-o", str(tmp_path / "snake.trc")]) == 0


def test_no_file_takes_the_place_of_one_beside_it(
    capsys: pytest.CaptureFixture[str], gappy: Exported, tmp_path: Path
) -> None:
    """The motion would be lost to its model."""
    output = tmp_path / "model.osim"
    assert main(["export", str(gappy.out), "--to", "mot", "-o", str(output)]) == 1
    assert "model.osim: would be two of the files to write" in " ".join(capsys.readouterr().err.split())
    assert not list(tmp_path.iterdir())

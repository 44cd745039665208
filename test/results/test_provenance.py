"""A result tells what it was made from, and when a map or a body is another."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.mcap_doctor import doctor, read_beside_messages
from helpers.naming import naming
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

import bodycam_ros
from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_identity import body_identity
from bodycam_ros.body.body_yaml import body_from_yaml
from bodycam_ros.camera import camera_from_info
from bodycam_ros.errors import RecordingError, StaticCameraError
from bodycam_ros.evaluate.image_views import static_camera_views
from bodycam_ros.formats.static_cameras_file import write_static_cameras
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.registration.map_identity import map_identity
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.provenance import (
    Provenance,
    body_record,
    check_same_inputs,
    map_record,
    settings_record,
    source_remarks,
)
from bodycam_ros.results.solved_recording import read_solved
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.viewer.sources import Sources


def test_one_file_tells_what_it_was_made_from(sample: Path, sample_out: Path) -> None:
    metadata, attachments = read_beside_messages(next(sample_out.glob("*.mcap")))
    body, reference_map = read_body(sample / "body.yaml"), ReferenceMap.load(sample / "map")
    assert metadata["bodycam_ros"]["command"] == "bodycam replay"
    assert metadata["bodycam_ros"]["version"] == bodycam_ros.__version__
    assert metadata["bodycam_ros"]["numpy"] == np.__version__
    assert metadata["map"] == map_record(reference_map, sample / "map")
    assert metadata["map"]["identity"] == str(map_identity(reference_map))
    assert metadata["body"] == {
        "name": "subject",
        "identity": body_identity(body),
        "measured_in_name": metadata["map"]["name"],
        "measured_in_identity": metadata["map"]["identity"],
    }
    assert metadata["recording"] == {
        "name": "bag",
        "start_ns": "1700000001000000000",
        "first_stamp_ns": "1700000001000000000",
    }
    assert metadata["settings"] == settings_record(PipelineSettings()) | {"passes": "1", "slim": "false"}
    assert json.loads(metadata["settings"]["estimator.output_delay"]) == PipelineSettings().estimator.output_delay
    assert body_identity(body_from_yaml(attachments["body.yaml"].decode())) == body_identity(body)
    with AnyReader([sample_out]) as bag:
        (verdict,) = bag.messages([each for each in bag.connections if each.topic == "/verdict"])
        told = bag.deserialize(verdict[2], verdict[0].msgtype)
    assert attachments["verdict.json"].decode() == told.data


def test_a_result_is_clean_and_both_libraries_read_the_same(sample_out: Path) -> None:
    file = next(sample_out.glob("*.mcap"))
    assert doctor(file) == []
    with file.open("rb") as opened:
        messages = list(make_reader(opened, validate_crcs=True).iter_messages())
    by_mcap = sorted((each.log_time, channel.topic, each.data) for _, channel, each in messages)
    with AnyReader([sample_out]) as bag:
        by_rosbags = sorted((stamp_ns, c.topic, bytes(raw)) for c, stamp_ns, raw in bag.messages())
    assert len(by_mcap) > 3000 and by_mcap == by_rosbags


def test_a_view_warns_of_another_map_and_another_body(
    sample: Path, sample_out: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    Sources(sample_out, sample / "map", sample / "body.yaml", None)
    assert not caplog.records
    hall = ReferenceMap.load(sample / "map")
    replace(hall, points_world=hall.points_world + 0.5).save(tmp_path / "cellar")
    write_body(replace(read_body(sample / "body.yaml"), name="ben"), tmp_path / "ben.yaml")
    Sources(sample_out, tmp_path / "cellar", tmp_path / "ben.yaml", None)
    of_map, of_body = (record.getMessage() for record in caplog.records)
    other = map_identity(ReferenceMap.load(tmp_path / "cellar"))
    assert f"was solved in map map ({map_identity(hall)})" in of_map and f"cellar is another map ({other})" in of_map
    assert "was solved with body subject (" in of_body and "ben.yaml is another body, ben (" in of_body


def test_static_cameras_in_another_map_are_warned_of(
    sample: Path, sample_out: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    hall = ReferenceMap.load(sample / "map")
    replace(hall, points_world=hall.points_world + 0.5).save(tmp_path / "cellar")
    lens = camera_from_info("corner", 640, 480, "plumb_bob", [0.0] * 5, [470.0, 0, 320, 0, 470, 240, 0, 0, 1])
    write_static_cameras(tmp_path / "cameras.yaml", [StaticCamera("corner", np.eye(4), lens)])
    files = StaticCameraFiles(tmp_path / "cameras.yaml", None, None)
    solved = read_solved(sample_out)
    for given, warned in ((sample / "map", []), (tmp_path / "cellar", ["cellar is another map"])):
        caplog.clear()
        with naming(StaticCameraError, sample / "sample" / "bag"):
            static_camera_views(solved, sample / "sample" / "bag", files, given)
        told = [record.getMessage() for record in caplog.records]
        assert len(told) == len(warned) and all(text in each for text, each in zip(warned, told, strict=True))


def test_a_bag_of_another_program_belongs_to_anything(sample: Path, sample_out: Path, tmp_path: Path) -> None:
    with AnyReader([sample_out]) as bag, write_recording(tmp_path / "live", command="a recorder") as writer:
        for connection, stamp_ns, raw in bag.messages():
            writer.write_serialized(connection.topic, connection.msgtype, stamp_ns, raw)
    made_from = Provenance.read(tmp_path / "live")
    assert made_from.lines == []
    assert made_from.map_difference(ReferenceMap.load(sample / "map"), sample / "map") is None
    assert made_from.body_difference(read_body(sample / "body.yaml"), sample / "body.yaml") is None


def test_a_body_of_another_place_is_remarked(sample: Path) -> None:
    body, hall = read_body(sample / "body.yaml"), map_record(ReferenceMap.load(sample / "map"), sample / "map")
    assert source_remarks({"body": body_record(body), "map": hall}) == (), "where it was measured is unknown"
    extended = hall | {"identity": f"{hall['identity']}+0123456789abcdef"}
    measured = body_record(replace(body, report={"map": extended}))
    assert source_remarks({"body": measured, "map": hall}) == ()
    garage = {"name": "garage", "identity": "0123456789abcdef"}
    (remark,) = source_remarks({"body": body_record(replace(body, report={"map": garage})), "map": hall})
    assert "subject was measured in map garage (0123456789abcdef) and solved in map map (" in remark
    assert source_remarks({"body": measured}) == (), "static cameras alone"


def test_records_before_the_damage_are_read(sample_out: Path, tmp_path: Path) -> None:
    content = next(sample_out.glob("*.mcap")).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) // 2])
    whole, cut = Provenance.read(sample_out).sources, Provenance.read(tmp_path / "cut.mcap").sources
    assert cut == whole and "map" in cut


@pytest.mark.parametrize("name", ["map", "body"])
def test_results_of_another_map_or_body_are_not_compared(sample_out: Path, name: str) -> None:
    ours = Provenance.read(sample_out)
    check_same_inputs(ours, ours)
    record = ours.records.metadata[name]
    changed = record | {"name": "another", "identity": record["identity"][::-1]}
    other = Provenance(Path("other"), replace(ours.records, metadata=ours.records.metadata | {name: changed}))
    with naming(RecordingError, "other", "another", name):
        check_same_inputs(ours, other)
    without = {key: value for key, value in ours.records.metadata.items() if key != name}
    check_same_inputs(ours, Provenance(Path("older"), replace(ours.records, metadata=without)))

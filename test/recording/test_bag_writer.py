"""A written bag is read by another library, and appears whole or not at all."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.mcap_doctor import doctor, read_beside_messages
from helpers.naming import naming
from helpers.tiny_bag import START_NS, write_tiny_bag
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from bodycam_ros.errors import OutputError
from bodycam_ros.messages.body import joint_state_message
from bodycam_ros.messages.diagnostics import text_message
from bodycam_ros.messages.factory import Message
from bodycam_ros.recording.bag_writer import RecordingWriter, write_recording
from bodycam_ros.recording.typestore import recorded_messages


def joints(stamp_ns: int) -> Message:
    return joint_state_message(
        recorded_messages(), stamp_ns, ["knee", "hip"], np.array([0.5, -0.25]), np.array([1.0, 2.0])
    )


def write(path: Path, force: bool = False) -> None:
    with write_recording(path, force) as writer:
        writer.write("/robot_description", START_NS, text_message(recorded_messages(), "<robot/>"))
        for frame in range(3):
            writer.write("/joint_states", START_NS + frame, joints(START_NS + frame))


def left_behind(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_any_reader_of_ros_bags_reads_it(tmp_path: Path) -> None:
    write(tmp_path / "out")
    with AnyReader([tmp_path / "out"]) as bag:
        states = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages() if c.topic == "/joint_states"]
    assert [s.header.stamp.nanosec for s in states] == [0, 1, 2]
    assert states[0].name == ["knee", "hip"]
    np.testing.assert_array_equal(states[0].position, [0.5, -0.25])


def test_both_libraries_read_the_same_messages(tmp_path: Path) -> None:
    write(tmp_path / "out")
    with (tmp_path / "out" / "out.mcap").open("rb") as file:
        messages = list(make_reader(file, validate_crcs=True).iter_messages())
        by_mcap = [
            (channel.topic, schema.name, message.log_time, message.data) for schema, channel, message in messages
        ]
    with AnyReader([tmp_path / "out"]) as bag:
        by_rosbags = [(c.topic, c.msgtype, stamp_ns, bytes(raw)) for c, stamp_ns, raw in bag.messages()]
    assert len(by_mcap) == 4
    assert by_mcap == by_rosbags


def test_a_bag_is_clean_and_carries_records_and_files(tmp_path: Path) -> None:
    with write_recording(tmp_path / "out") as writer:
        writer.add_metadata("map", {"identity": "abc", "name": "hall\udcff"})
        for frame in range(40):  # several chunks
            noise = np.random.default_rng(frame).bytes(100_000).hex()
            writer.write("/noise", START_NS + frame, text_message(recorded_messages(), noise))
            writer.write("/joint_states", START_NS + 40 - frame, joints(START_NS + frame))
            if frame == 20:
                writer.attach("body.yaml", "application/yaml", "name: \u00e9", START_NS)
    file = tmp_path / "out" / "out.mcap"
    assert doctor(file) == []
    metadata, attachments = read_beside_messages(file)
    assert metadata["map"] == {"identity": "abc", "name": "hall\\udcff"}
    stored = yaml.safe_load(metadata["rosbag2"]["serialized_metadata"])
    document = yaml.safe_load((tmp_path / "out" / "metadata.yaml").read_text())
    assert stored == document["rosbag2_bagfile_information"]
    assert attachments == {"body.yaml": "name: \u00e9".encode()}
    assert file.stat().st_size < 6_000_000  # of 8 MB


def test_the_doctor_finds_what_is_changed(tmp_path: Path) -> None:
    write(tmp_path / "out")
    file = tmp_path / "out" / "out.mcap"
    content = file.read_bytes()
    index = content.rindex(b"/joint_states")  # in the summary
    file.write_bytes(content[:index] + b"/joint_stateX" + content[index + 13 :])
    found = " ".join(doctor(file))
    assert "channels at the end" in found and "the summary has another checksum" in found


def test_latched_topics_say_so_in_the_metadata(tmp_path: Path) -> None:
    write(tmp_path / "out")
    information = yaml.safe_load((tmp_path / "out" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    quality = {
        t["topic_metadata"]["name"]: t["topic_metadata"]["offered_qos_profiles"]
        for t in information["topics_with_message_count"]
    }
    (latched,) = quality["/robot_description"]
    assert latched["durability"] == "transient_local"
    assert latched["reliability"] == "reliable"
    assert quality["/joint_states"] == []


@pytest.mark.parametrize("interruption", [RuntimeError, KeyboardInterrupt])
def test_an_interrupted_recording_leaves_nothing(tmp_path: Path, interruption: type[BaseException]) -> None:
    with pytest.raises(interruption), write_recording(tmp_path / "out") as writer:
        writer.write("/joint_states", START_NS, joints(START_NS))
        raise interruption
    assert left_behind(tmp_path) == []


def test_an_interrupted_replacement_keeps_the_old_bag(tmp_path: Path) -> None:
    write(tmp_path / "out")
    before = (tmp_path / "out" / "out.mcap").read_bytes()
    with pytest.raises(RuntimeError), write_recording(tmp_path / "out", force=True) as writer:
        writer.write("/joint_states", START_NS, joints(START_NS))
        raise RuntimeError
    assert (tmp_path / "out" / "out.mcap").read_bytes() == before
    assert left_behind(tmp_path) == ["out"]


def test_existing_bag_is_replaced_only_when_forced(tmp_path: Path) -> None:
    write(tmp_path / "out")
    with naming(OutputError, tmp_path / "out", "--force"):
        write(tmp_path / "out")
    write(tmp_path / "out", force=True)
    assert left_behind(tmp_path) == ["out"]


@pytest.mark.parametrize("failing", [1, 2])
def test_a_rename_that_fails_leaves_one_whole_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: int
) -> None:
    write(tmp_path / "out")
    before = (tmp_path / "out" / "out.mcap").read_bytes()
    rename, calls = Path.rename, iter(range(1, 100))

    def fail_once(self: Path, target: Path) -> Path:
        if next(calls) == failing:
            raise OSError(5, "Input/output error")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail_once)
    with naming(OutputError, tmp_path / "out", "Input/output error"):
        write(tmp_path / "out", force=True)
    assert (tmp_path / "out" / "out.mcap").read_bytes() == before
    assert left_behind(tmp_path) == ["out"]


def test_a_recording_is_never_replaced(tiny_bag: Path) -> None:
    """Not even one of everything that a live graph published: its images cannot be made again."""

    def alter(writer: RecordingWriter) -> None:
        for frame in range(3):
            writer.write("/joint_states", START_NS + frame, joints(START_NS + frame))
        writer.write("/robot_description", START_NS, text_message(recorded_messages(), "<robot/>"))

    live = write_tiny_bag(tiny_bag.parent / "live", alter=alter)
    for recording in (tiny_bag, live):
        with naming(OutputError, recording, "bodycam replay", "--force"):
            write(recording, force=True)


def test_folder_that_is_no_bag_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "thesis.txt").write_text("ten years of work")
    with naming(OutputError, tmp_path / "precious", "thesis.txt"):
        write(tmp_path / "precious", force=True)
    assert (tmp_path / "precious" / "thesis.txt").exists()


def test_unwritable_place_is_an_error_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with naming(OutputError, tmp_path / "file" / "out"):
        write(tmp_path / "file" / "out")
    assert left_behind(tmp_path) == ["file"]


def test_two_recordings_of_the_same_messages_are_identical(tmp_path: Path) -> None:
    write(tmp_path / "a" / "out")
    write(tmp_path / "b" / "out")
    assert (tmp_path / "a" / "out" / "out.mcap").read_bytes() == (tmp_path / "b" / "out" / "out.mcap").read_bytes()

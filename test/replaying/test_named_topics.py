"""Two people in one bag, each in a namespace, and a bag of drivers with other names: solved as if it were their own."""

from pathlib import Path

import numpy as np
import pytest
from helpers.altered_sample import CAMERAS, write_altered_sample

from bodycam_ros.cli.main import main
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.topic_names import TopicNames
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved


def _solved(sample: Path, bag: Path, out: Path, *flags: str) -> SolvedRecording:
    words = ["--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "-o", str(out), "--jobs", "1", *flags]
    assert main(["replay", str(bag), *words]) in (0, 3)
    return read_solved(out)


@pytest.fixture(scope="module")
def plain(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, SolvedRecording]:
    folder = tmp_path_factory.mktemp("plain")
    bag = write_altered_sample(sample, folder / "bag")
    return bag, _solved(sample, bag, folder / "out")


def test_two_people_of_one_bag_are_both_solved(
    sample: Path, tmp_path: Path, plain: tuple[Path, SolvedRecording]
) -> None:
    bag, expected = plain
    both = tmp_path / "both"
    with BagFile(bag) as one, write_recording(both) as writer:
        for topic, stamp_ns, message in one.messages([*one.topics]):
            for person in ("/anna", "/ben"):
                writer.write(f"{person}{topic}", stamp_ns, message)
    for person in ("anna", "ben"):
        solved = _solved(sample, both, tmp_path / person, "--prefix", person)
        np.testing.assert_array_equal(solved.stamps_ns, expected.stamps_ns)
        for link, poses in expected.world_T_link.items():
            np.testing.assert_array_equal(solved.world_T_link[link], poses)
    assert main(["doctor", str(both), "--prefix", "/anna", "--body", str(sample / "body.yaml")]) in (0, 3)


def test_topics_of_other_drivers_are_read_by_a_table(
    sample: Path, tmp_path: Path, plain: tuple[Path, SolvedRecording]
) -> None:
    names = {camera: f"cam{number}/color" for number, camera in enumerate(CAMERAS)}
    foreign = write_altered_sample(sample, tmp_path / "foreign", names=names)
    rows = [f"{camera}=/{name}/image_raw" for camera, name in names.items()]
    with open_recording(foreign, TopicNames.parse("", rows)) as recording:
        assert recording.cameras == tuple(sorted(CAMERAS))
    solved = _solved(sample, foreign, tmp_path / "out", "--topics", *rows)
    np.testing.assert_array_equal(solved.stamps_ns, plain[1].stamps_ns)

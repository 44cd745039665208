"""Names as others allow them, one for each; what is written of one never replaces what is written of another."""

from dataclasses import replace
from pathlib import Path

import pytest

from bodycam_ros.files.distinct_names import distinct_names
from bodycam_ros.formats.sampled_motion import MotionOptions, sample_motion
from bodycam_ros.formats.tum import write_tum
from bodycam_ros.results.solved_body import read_solved_body


def plain(name: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in name)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["a b", "a_b"], ["a_b_2", "a_b"]),
        (["a b", "a-b", "a_b_2"], ["a_b", "a_b_3", "a_b_2"]),
        (["A", "a"], ["A", "a_2"]),
        (["left", "right"], ["left", "right"]),
    ],
)
def test_every_name_has_a_form_of_its_own(names: list[str], expected: list[str]) -> None:
    assert distinct_names(names, plain) == dict(zip(names, expected, strict=True))


def test_tum_of_segments_with_similar_names_is_a_file_each(sample_out: Path) -> None:
    motion = sample_motion(read_solved_body(sample_out), None, even=False)
    body = motion.body
    names = {"thigh_left": "a b", "thigh_right": "a_b"}
    renamed = replace(
        body,
        segments=tuple(names.get(segment, segment) for segment in body.segments),
        joints=tuple(
            replace(joint, parent=names.get(joint.parent, joint.parent), child=names.get(joint.child, joint.child))
            for joint in body.joints
        ),
        mounts={},
    )
    files = write_tum(replace(motion, body=renamed), MotionOptions(segment="all"))
    assert len(files) == len(body.segments)
    assert {".a_b.tum", ".a_b_2.tum"} < files.keys() and files[".a_b.tum"] != files[".a_b_2.tum"]

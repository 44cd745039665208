"""What pages and pictures of the documentation say of the code is what the code says.

BODYCAM_DOCS=1 pytest test/docs/test_made_of_code.py     writes them anew
"""

import os
import re
from pathlib import Path

import cv2
import numpy as np
from joint_table import BEGIN, END, joint_table
from strap_on_picture import strap_on_png

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.joint_angles import JointAngles
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.recording.bag_file import BagFile

REPOSITORY = Path(__file__).parents[2]
JOINTS, PICTURE = REPOSITORY / "docs/joints.md", REPOSITORY / "docs/strap_on.png"
OF_255, A_MARK_PX = 64, 60  # the edges of letters differ by less; a camera that sits elsewhere changes more pixels
WRITE = bool(os.environ.get("BODYCAM_DOCS"))


def test_the_joint_table_is_what_the_code_says() -> None:
    text = JOINTS.read_text()
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    made = f"{before}{BEGIN}\n\n{joint_table(REPOSITORY)}\n\n{END}{after}"
    if WRITE:
        JOINTS.write_text(made)
    assert JOINTS.read_text() == made


def test_every_angle_of_the_sample_is_in_the_table() -> None:
    named = set(re.findall(r"^\| `(\w+)`", joint_table(REPOSITORY), re.MULTILINE))
    angles = JointAngles(read_body(REPOSITORY / "bags/body.yaml")).names
    assert {re.sub("_(left|right)_", "_S_", angle) for angle in angles} <= named


def test_the_picture_of_cameras_is_what_is_drawn() -> None:
    body = read_body(REPOSITORY / "bags/body.yaml")
    drawn = strap_on_png(body)
    if WRITE:
        PICTURE.write_bytes(drawn)
    kept, now = cv2.imread(str(PICTURE)), cv2.imdecode(np.frombuffer(drawn, np.uint8), cv2.IMREAD_COLOR)
    assert kept.shape == now.shape
    strong = cv2.absdiff(kept, now).max(axis=2) > OF_255
    assert np.count_nonzero(strong) < A_MARK_PX


def test_the_topics_in_the_page_are_those_of_a_solved_bag(sample_out: Path) -> None:
    rows = re.findall(
        r"^\| `(/[\w/]+)` \| `([\w/]+)` \|", (REPOSITORY / "docs/roboticists.md").read_text(), re.MULTILINE
    )
    with BagFile(sample_out) as bag:
        assert {topic: bag.topics.get(topic.replace("CAMERA", "head")) for topic, _ in rows} == dict(rows)


def test_the_rig_in_the_page_is_the_one_in_the_picture() -> None:
    text = (REPOSITORY / "docs/strap_on.md").read_text()
    cameras = Rig.from_yaml(REPOSITORY / "bags/sample/rig.yaml").cameras
    rows = dict(re.findall(r"^\| `(\w+)` \| (\w+) \|", text, re.MULTILINE))
    assert rows == dict(cameras)

"""The package as a library: the lines in the README, and what they give against ``bodycam replay``."""

import dataclasses
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
from helpers.naming import naming
from static_cameras.painted_bag import dressed_body, write_painted

from bodycam_ros import Body, CameraModel, Map, StaticCameraFiles, replay
from bodycam_ros.camera.camera_image import decode_colour
from bodycam_ros.camera.camera_info import camera_info_yaml
from bodycam_ros.cli.main import main
from bodycam_ros.errors import BodyError
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.results.solved_recording import read_solved

REPOSITORY = Path(__file__).parent.parent
_ENVIRONMENT = """
import os, cv2  # which sets some itself
before = dict(os.environ)
from bodycam_ros import Body, Map, replay
assert os.environ == before
import lz4, rosbags.rosbag2.storage_mcap as rosbags
assert all("bodycam" not in unpack.__module__ for unpack in rosbags.DECOMPRESSORS.values())
"""


def test_the_lines_in_the_readme_run_as_they_stand() -> None:
    (lines,) = re.findall(r"```python\n(from bodycam_ros import.*?)```", (REPOSITORY / "README.md").read_text(), re.S)
    assert lines.count("\n") <= 10
    run = subprocess.run([sys.executable, "-c", lines], cwd=REPOSITORY, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    assert len(run.stdout.splitlines()) == 60


def test_importing_it_sets_nothing_in_its_host() -> None:
    surroundings = {name: text for name, text in os.environ.items() if not name.startswith("OPENCV_")}
    subprocess.run([sys.executable, "-c", _ENVIRONMENT], env=surroundings, check=True, timeout=60)


def test_states_are_those_of_a_replay(sample: Path, sample_out: Path) -> None:
    body, reference_map = Body.load(sample / "body.yaml"), Map.load(sample / "map")
    states = replay(sample / "sample" / "bag", reference_map, body)
    outputs = list(states)
    solved = read_solved(sample_out)
    np.testing.assert_array_equal([output.state.stamp_ns for output in outputs], solved.stamps_ns)
    poses = np.stack([solved.world_T_link[segment] for segment in body.segments], axis=1)
    np.testing.assert_allclose([output.state.world_T_segment for output in outputs], poses, atol=1e-6)
    assert solved.stored_verdict is not None and solved.stored_verdict.level is states.verdict.level
    assert [(each.subject, each.check) for each in states.verdict.findings] == [
        (each.subject, each.check) for each in solved.stored_verdict.findings
    ]


def test_static_cameras_are_those_of_a_replay(sample: Path, tmp_path: Path) -> None:
    files = tmp_path / "painted"
    files.mkdir()
    write_painted(dressed_body(sample), files)
    given = StaticCameraFiles(files / "cameras.yaml", start=files / "start.yaml")
    states = replay(files / "bag", None, Body.load(sample / "body.yaml"), static_cameras=given)
    outputs = list(states)
    command = ["replay", files / "bag", "--body", sample / "body.yaml", "-o", tmp_path / "out", "--jobs", 1]
    main([*map(str, command), "--stations", str(given.stations), "--start", str(given.start)])
    solved = read_solved(tmp_path / "out")
    poses = np.stack([solved.world_T_link[segment] for segment in outputs[0].state.segments], axis=1)
    np.testing.assert_allclose([output.state.world_T_segment for output in outputs], poses, atol=1e-6)
    assert solved.stored_verdict is not None and solved.stored_verdict.level is states.verdict.level


def test_live_states_come_while_images_are_given(sample: Path) -> None:
    body, reference_map = Body.load(sample / "body.yaml"), Map.load(sample / "map")
    given = 0
    with open_recording(sample / "sample" / "bag") as recording:
        cameras = {camera: recording.camera_model(camera) for camera in recording.cameras}
        total = sum(1 for _ in recording.images())

        def images():  # type: ignore[no-untyped-def]
            nonlocal given
            for image in recording.images():
                given += 1
                yield image

        states = replay(images(), reference_map, body, cameras, live=True)
        assert next(states).state.cameras_used > 10
        assert given < 0.7 * total


def test_images_without_models_are_refused(sample: Path) -> None:
    body, reference_map = Body.load(sample / "body.yaml"), Map.load(sample / "map")
    with naming(BodyError, "models"):
        next(replay([], reference_map, body))


def test_lenses_are_read_from_their_files(sample: Path, tmp_path: Path) -> None:
    """Images in colour, and a lens of which the path is given."""
    body, reference_map = Body.load(sample / "body.yaml"), Map.load(sample / "map")
    with open_recording(sample / "sample" / "bag") as recording:
        model = recording.camera_model("waist_front")
        images = [
            dataclasses.replace(image, content=decode_colour(image)) for image in recording.images(["waist_front"])
        ][:9]
    (tmp_path / "lens.yaml").write_text(camera_info_yaml(model))
    of_file, of_model = (
        replay(images, reference_map, body, {"waist_front": lens}, live=True)
        for lens in (tmp_path / "lens.yaml", model)
    )
    poses = [[output.state.world_T_segment for output in states] for states in (of_file, of_model)]
    assert poses[0]
    np.testing.assert_array_equal(*poses)


def test_an_argument_of_another_kind_is_named(sample: Path) -> None:
    body, reference_map = Body.load(sample / "body.yaml"), Map.load(sample / "map")
    wrong: tuple[tuple[str, tuple[object, ...]], ...] = (
        ("reference_map", ([], str(sample / "map"), body)),
        ("body", ([], reference_map, "body.yaml")),
        ("images", (5, reference_map, body)),
        ("cameras", ([], reference_map, body, ["head.yaml"])),
        ("cameras['head']", ([], reference_map, body, {"head": 5})),
    )
    for named, arguments in wrong:
        with naming(TypeError, named):
            replay(*arguments)  # type: ignore[arg-type]
    model = CameraModel("head", 640, 480, 300.0, 300.0, 320.0, 240.0, (), "plumb_bob")
    pixels = np.zeros((480, 640), np.uint8)
    with naming(TypeError, "ndarray", "CameraImage"):
        next(replay([pixels], reference_map, body, {"head": model}))  # type: ignore[list-item]

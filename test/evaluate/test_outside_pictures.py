"""Pictures of a painted person before three static cameras, whose every pose is known."""

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from known_walk import FRAME_NS, START_NS, Walk, write_solved
from outside.dressed_body import DressedBody, small_motion, stations_around
from station_words import said
from unshown_progress import Unshown

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.cli.main import main
from bodycam_ros.drawing.picture_style import LEFT, RIGHT, TRUTH
from bodycam_ros.errors import StationError
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.feet_picture import draw_feet, true_ways, ways
from bodycam_ros.evaluate.outside_picture import OutsideView, draw_outside, outside_views
from bodycam_ros.evaluate.outside_scene import OutsideFiles, OutsideScene
from bodycam_ros.evaluate.outside_video import draw_outside_video
from bodycam_ros.messages.header import header_message
from bodycam_ros.messages.map_points import map_points_message
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.contour_painting import CONTOUR, INWARD, OUTWARD, bgr
from bodycam_ros.outside.stations_file import write_stations
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.solved.solved_recording import read_solved
from bodycam_ros.video.video_file import frames, read_facts
from bodycam_ros.video.video_frame import bgr_pixels

FRAMES = 6


@dataclass(frozen=True)
class Watched:
    """A person, the bag of a perfect solution, the recording, and where the cameras stand."""

    walk: Walk
    solved: Path
    recording: Path
    stations: Path

    def command(self, output: Path, *more: object, **instead: Path) -> list[str]:
        given = {"recording": self.recording, "stations": self.stations} | instead
        flags = [str(word) for name, path in given.items() for word in (f"--{name}", path)]
        return ["evaluate", str(self.solved), *flags, "-o", str(output), *map(str, more)]


@pytest.fixture(scope="module")
def watched(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Watched:
    folder = tmp_path_factory.mktemp("watched")
    body = replace(read_body(sample / "body.yaml"), mounts={})
    dressed = DressedBody(body, capsule_surfaces(body), stations_around(3))
    walk = Walk(body, START_NS + FRAME_NS * np.arange(FRAMES, dtype=np.int64), small_motion(body, FRAMES))
    solved = solution(walk, folder / "out")
    make = recorded_messages()
    with write_recording(folder / "bag") as writer:
        for frame, (stamp_ns, poses) in enumerate(zip(walk.stamps_ns.tolist(), walk.world_T_segment, strict=True)):
            for station, image in dressed.images(poses, 1.0, frame).items():
                header = header_message(make, stamp_ns, optical_frame(station))
                data = cv2.imencode(".png", image)[1].reshape(-1)
                message = make("sensor_msgs/msg/CompressedImage", header=header, format="png", data=data)
                writer.write(f"/{station}/image_raw/compressed", stamp_ns, message)
    write_stations(folder / "cameras.yaml", dressed.stations.values())
    return Watched(walk, solved, folder / "bag", folder / "cameras.yaml")


def solution(walk: Walk, path: Path, in_map: bool = False) -> Path:
    points = map_points_message(recorded_messages(), START_NS, np.zeros((1, 3)), np.zeros((1, 3), np.uint8))
    more = [*said(walk, "ext_00"), *([("/map/points", START_NS, points)] if in_map else [])]
    return write_solved(walk, path, more=more)


def views_of(watched: Watched, solved: Path) -> tuple[OutsideView, ...]:
    read = read_solved(solved)
    scene = OutsideScene.read(read, watched.recording, OutsideFiles(watched.stations))
    return outside_views(scene, read, watched.recording)


def share_of(colour: str, picture: Path, within: int = 20) -> float:
    """Share of a picture's pixels that have a colour, about."""
    pixels = cv2.imread(str(picture)).astype(int)
    return float((np.abs(pixels - bgr(colour)).max(axis=2) <= within).mean())


def test_the_command_draws_them_all(watched: Watched, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(watched.command(tmp_path / "report", "--video", "ext_01")) == 0
    written = sorted(path.name for path in (tmp_path / "report").iterdir())
    assert written == [
        "feet.png",
        "outside.mp4",
        "outside.png",
        "report.html",
        "report.md",
        "summary.json",
        "summary.png",
    ]
    assert share_of(CONTOUR, tmp_path / "report" / "outside.png") > 1e-3
    assert "static cameras" in capsys.readouterr().out
    facts = read_facts(tmp_path / "report" / "outside.mp4")
    assert (facts.frames, facts.width, facts.height) == (FRAMES, 1280, 960)
    assert facts.rate_hz == pytest.approx(1e9 / FRAME_NS, rel=0.01)
    assert main(watched.command(tmp_path / "report")) == 0  # its own pictures may be replaced


def test_lines_agree_with_a_solution_that_is_right_and_pull_on_one_that_is_not(
    watched: Watched, tmp_path: Path
) -> None:
    beside = np.eye(4)
    beside[:3, 3] = [0.02, -0.015, 0.01]
    off = []
    for name, walk in (("right", watched.walk), ("off", watched.walk.moved(beside))):
        views = views_of(watched, solution(walk, tmp_path / name))
        assert [view.station for view in views] == ["ext_00", "ext_01", "ext_02"]
        off.append(np.nanmean([np.nanmean(np.abs(view.contour.shifts)) for view in views]))
        draw_outside(views, tmp_path / f"{name}.png")
    assert off[0] < 0.9 and off[1] > 1.5 * off[0]
    for colour in (INWARD, OUTWARD):
        right, wrong = (share_of(colour, tmp_path / f"{name}.png") for name in ("right", "off"))
        assert wrong > 1.3 * right > 0.0, colour


def test_the_window_is_around_the_body(watched: Watched) -> None:
    for view in views_of(watched, watched.solved):
        window, height = view.window, view.image.shape[0]
        low, high = view.contour.covered
        assert window.left <= low[0] and window.left + window.width >= high[0]
        assert window.top >= 0 and window.top + window.height <= height
        assert window.width * window.times >= 640


def test_contour_points_are_painted_into_the_video(watched: Watched, tmp_path: Path) -> None:
    solved, progress = read_solved(watched.solved), Unshown()
    scene = OutsideScene.read(solved, watched.recording, OutsideFiles(watched.stations))
    draw_outside_video(scene, solved, watched.recording, "ext_02", tmp_path / "v.mp4", progress)
    assert progress.done == {"v.mp4": FRAMES} == progress.totals
    last = [bgr_pixels(frame).astype(int) for _, frame in frames(tmp_path / "v.mp4")][-1]
    poses = scene.poses_at(int(solved.stamps_ns[-1]))
    np.testing.assert_allclose(
        poses, watched.walk.world_T_segment[-1][[watched.walk.body.segment_index[s] for s in scene.body.segments]],
        atol=1e-6,
    )  # fmt: skip
    contour = scene.contour("ext_02", np.zeros((480, 640, 3), np.uint8), poses)
    columns, rows = np.rint(2.0 * (contour.pixels + 0.5) - 0.5).astype(int).T
    there = (rows > 0) & (rows < 960) & (columns > 0) & (columns < 1280)
    blue, green, red = last[rows[there], columns[there]].T
    assert np.median(np.minimum(green, red) - blue) > 60  # yellow, whatever the codec does to it


def test_the_balls_of_the_feet_go_where_they_went(watched: Watched, tmp_path: Path) -> None:
    evaluation = evaluate(watched.solved)
    drawn = ways(evaluation)
    assert list(drawn) == ["foot_left", "foot_right"]
    ankle = watched.walk.world_T_segment[:, watched.walk.body.segment_index["foot_left"], :3, 3]
    distance_mm = np.linalg.norm(drawn["foot_left"] - 1e3 * ankle, axis=1)
    assert np.ptp(distance_mm) < 0.01 and 80.0 < distance_mm[0] < 250.0
    draw_feet(evaluation, tmp_path / "feet.png")
    assert min(share_of(colour, tmp_path / "feet.png") for colour in (LEFT, RIGHT)) > 1e-5


def test_a_true_way_lies_beneath_one_that_is_perfect(solved: Path, truth: Path, tmp_path: Path) -> None:
    evaluation = evaluate(solved, truth)
    ours, true = ways(evaluation), true_ways(evaluation)
    np.testing.assert_allclose(true["foot_left"], ours["foot_left"], atol=1e-3)
    draw_feet(evaluation, tmp_path / "with.png")
    draw_feet(replace(evaluation, comparison=None), tmp_path / "without.png")
    assert share_of(TRUTH, tmp_path / "with.png", 30) > share_of(TRUTH, tmp_path / "without.png", 30) + 1e-4


@pytest.mark.parametrize(
    ("flags", "told"),
    [
        ("--surface meshes", "--surface is for static cameras: say with --stations where they stand"),
        ("--video ext_00", "--video is for static cameras"),
        ("--map map", "--map is for static cameras"),
        ("--stations {stations}", "--stations: needs the images of static cameras: give the bag with --recording"),
        ("--recording {recording} --stations {stations} --video ext_7", "'ext_7': is no static camera that"),
        ("--recording {recording} --stations {recording}/metadata.yaml", "metadata.yaml: camera"),
        ("--recording {recording} --stations {stations} --surface {recording}", "has no mesh of any segment"),
        ("--recording {recording} --stations {board} --map {map}", "was solved without a map"),
    ],
)
def test_what_does_not_fit_is_named(
    watched: Watched, sample: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], flags: str, told: str
) -> None:
    board = tmp_path / "board.yaml"
    board.write_text(watched.stations.read_text().replace("T_map_cam", "T_board_cam"))
    flags = flags.format(stations=watched.stations, recording=watched.recording, map=sample / "map", board=board)
    assert main(["evaluate", str(watched.solved), "-o", str(tmp_path / "report"), *flags.split()]) == 1
    assert told in capsys.readouterr().err.replace("\n", " ")
    assert not (tmp_path / "report").exists()


def test_a_recording_of_other_cameras_is_refused(watched: Watched, tmp_path: Path) -> None:
    text = watched.stations.read_text().replace("ext_", "door_")
    (tmp_path / "others.yaml").write_text(text)
    with pytest.raises(StationError, match=r"bag has no images of the static cameras of .*others\.yaml \(door_00"):
        OutsideScene.read(read_solved(watched.solved), watched.recording, OutsideFiles(tmp_path / "others.yaml"))


def test_stations_on_a_board_need_the_map_that_was_solved_in(watched: Watched, sample: Path, tmp_path: Path) -> None:
    (tmp_path / "board.yaml").write_text(watched.stations.read_text().replace("T_map_cam", "T_board_cam"))
    solved = read_solved(solution(watched.walk, tmp_path / "out", in_map=True))
    with pytest.raises(StationError, match="T_board_cam where cameras stand.*--map"):
        OutsideScene.read(solved, watched.recording, OutsideFiles(tmp_path / "board.yaml"))
    OutsideScene.read(solved, watched.recording, OutsideFiles(tmp_path / "board.yaml", map=sample / "map"))
    OutsideScene.read(solved, watched.recording, OutsideFiles(watched.stations))


def test_an_image_that_cannot_be_read_leaves_nothing_behind(
    watched: Watched, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = watched.stations.read_text().replace("width: 640", "width: 720")
    (tmp_path / "larger.yaml").write_text(text)
    assert main(watched.command(tmp_path / "report", stations=tmp_path / "larger.yaml")) == 1
    assert "an image of 640x480 px; cameras.yaml says that the lens is for 720x480" in capsys.readouterr().err
    assert not (tmp_path / "report").exists()

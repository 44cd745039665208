"""Films of the sample, by the command, read back."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.surface_folder import read_surfaces
from bodycam_ros.film.character import Character
from bodycam_ros.film.frames import EvenFrames, RecordedFrames
from bodycam_ros.film.shots import CameraShots, OutsideShots, letterboxed
from bodycam_ros.film.write_film import FilmedMotion
from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.results.solved_body import read_solved_body

SIZE = (320, 180)


def film(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "film", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def read_film(path: Path) -> tuple[list[float], list[NDArray[np.uint8]], str]:
    with av.open(str(path)) as container:
        frames = [(float(f.pts * f.time_base), f.to_ndarray(format="bgr24")) for f in container.decode(video=0)]
        return (
            [t for t, _ in frames],
            [np.asarray(p, np.uint8) for _, p in frames],
            container.streams.video[0].codec.name,
        )


def blue(picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Where the shirt is: nothing else is so blue."""
    channels = picture.astype(int)
    return np.asarray(channels[..., 0] - channels[..., 2] > 60)


@pytest.mark.parametrize("view", ["follow", "orbit", "fixed"])
def test_the_person_is_where_the_view_projects_them(view: str, sample_out: Path, tmp_path: Path) -> None:
    path = tmp_path / "walk.mp4"
    result = film(sample_out, "-o", path, "--view", view, "--size", "320x180", "--rate", 5)
    assert result.returncode == 0, result.stderr
    seconds, pictures, codec = read_film(path)
    solved = read_solved_body(sample_out)
    frames = EvenFrames(solved, 5.0)
    assert codec == "h264"
    assert f"{len(frames.stamps_ns)} frames" in result.stdout
    np.testing.assert_allclose(seconds, (frames.stamps_ns - frames.stamps_ns[0]) * 1e-9, atol=1e-4)
    assert {picture.shape for picture in pictures} == {(SIZE[1], SIZE[0], 3)}
    motion = FilmedMotion(solved, frames)
    shots = OutsideShots(view, motion.seconds, motion.facing, motion.boxes, SIZE)
    for row, picture in enumerate(pictures):
        camera_T_world = inverse(shots.pose(row))
        torso = motion.world_T_segment[row, solved.body.segment_index["torso"], :3, 3] + [0.0, 0.0, 0.2]
        (u, v), *_ = np.round(shots.lens.project(transform_points(camera_T_world, torso[None]))[0]).astype(int)
        shirt = blue(picture)
        assert shirt[v - 2 : v + 3, u - 2 : u + 3].any(), row
        pixels = shots.lens.project(transform_points(camera_T_world, motion.mesh(row).vertices.astype(float)))[0]
        rows, columns = np.nonzero(shirt)
        assert (np.stack([columns, rows], axis=1) > pixels.min(axis=0) - 2).all()
        assert (np.stack([columns, rows], axis=1) < pixels.max(axis=0) + 2).all()
        assert (pixels.min(axis=0) > 0).all() and (pixels.max(axis=0) < SIZE).all(), (
            "the whole person is in the picture"
        )


def test_a_body_camera_has_the_person_over_its_images_and_these_beside(
    sample: Path, sample_out: Path, tmp_path: Path
) -> None:
    path, bag = tmp_path / "foot.mp4", sample / "sample" / "bag"
    given = ("--map", sample / "map", "--recording", bag, "--size", "640x180", "--from", 1.0, "--to", 1.3)
    result = film(sample_out, "-o", path, *given, "--view", "camera:foot_right", "--beside", "foot_right")
    assert result.returncode == 0, result.stderr
    assert "nothing hides the person" in result.stdout
    seconds, pictures, _ = read_film(path)
    solved = read_solved_body(sample_out)
    recorded = RecordedFrames(bag, solved, "foot_right", "")
    images = dict(zip(recorded.stamps_ns.tolist(), recorded.images(), strict=True))
    assert len(pictures) == pytest.approx(0.3 * recorded.rate_hz, abs=1.5)
    np.testing.assert_allclose(np.diff(seconds), 1.0 / recorded.rate_hz, rtol=0.2)
    best = [
        min(np.abs(p[:, 320:].astype(int) - letterboxed(i, SIZE)).mean() for i in images.values()) for p in pictures
    ]
    assert max(best) < 4.0, "what compression loses"
    # The recorded images show the person themselves, dark: it is drawn over what is dark beside it.
    for picture in pictures:
        left, beside = picture[:, :320].astype(int), picture[:, 320:].astype(int)
        drawn = np.abs(left - beside).sum(axis=2) > 90
        assert drawn.sum() > 100
        assert beside[drawn].mean() < 70 < beside[20:160, 60:260].mean()


def test_a_photograph_of_the_map_has_the_person_in_it(sample: Path, sample_out: Path, tmp_path: Path) -> None:
    path = tmp_path / "photo.png"
    result = film(sample_out, "-o", path, "--map", sample / "map", "--view", "photo:ref_0048", "--size", "640x480")
    assert result.returncode == 0, result.stderr
    picture = cv2.imread(str(path))
    assert picture.shape == (480, 640, 3)
    assert blue(picture).sum() > 3000
    grey = np.ptp(picture.astype(int), axis=2) == 0
    assert grey.mean() > 0.7, "the rest is the photograph, which is grey"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--view", "above"), "follow, orbit, fixed"),
        (("--view", "camera:head"), "--recording"),
        (("--view", "photo:x"), "--map"),
        (("--view", "camera:nose", "--recording", "BAG"), "foot_left"),
        (("--view", "photo:nose", "--map", "MAP"), "ref_0000"),
        (("--beside", "head", "--recording", "BAG", "--view", "camera:foot_left"), "--beside"),
    ],
)
def test_what_is_wrong_is_named_and_nothing_is_left(
    words: tuple[str, ...], expected: str, sample: Path, sample_out: Path, tmp_path: Path
) -> None:
    places = {"BAG": sample / "sample" / "bag", "MAP": sample / "map"}
    result = film(sample_out, "-o", tmp_path / "x.mp4", *(places.get(word, word) for word in words))
    assert result.returncode == 1
    assert expected in result.stderr
    assert not list(tmp_path.iterdir())


def test_an_interrupted_film_leaves_nothing(sample_out: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "film", str(sample_out), "-o", str(tmp_path / "x.mp4")]
    running = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob(".bodycam.*/x.mp4")) and running.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)
    assert list(tmp_path.iterdir()), "it has begun to write"
    running.send_signal(signal.SIGINT)
    running.communicate(timeout=120)
    assert running.returncode == 130
    assert not list(tmp_path.iterdir())


def test_the_person_wears_what_belongs_to_each_part(sample_out: Path) -> None:
    solved = read_solved_body(sample_out)
    mesh = Character(solved.body).posed(solved.world_T_segment[0])
    worn = mesh.shares.argmax(axis=1)
    heights = [np.median(mesh.vertices[worn == garment, 2]) for garment in range(4)]
    skin, shirt, trousers, shoes = heights
    assert shoes < trousers < shirt
    assert skin > trousers
    head = solved.world_T_segment[0, solved.body.segment_index["head"]]
    hair, soles = (mesh.vertices[worn == garment] for garment in (4, 5))
    in_head = transform_points(inverse(head), hair.astype(float))
    assert in_head[:, 0].mean() < -0.01 and in_head[:, 2].min() > 0.05, "the face is left free"
    assert np.median(soles[:, 2]) < shoes


def test_a_scan_is_the_person(sample_out: Path, tmp_path: Path) -> None:
    solved = read_solved_body(sample_out)
    head = capsule_surfaces(solved.body)["head"]
    scan = tmp_path / "scan"
    scan.mkdir()
    trimesh.Trimesh(head.vertices * [1.0, 1.0, 1.5], head.faces, process=False).export(scan / "head.obj")
    tall = [
        np.ptp(Character(solved.body, scanned=scanned).posed(solved.world_T_segment[0]).vertices[:, 2])
        for scanned in (None, read_surfaces(scan, solved.body))
    ]
    assert tall[1] - tall[0] == pytest.approx(0.5 * head.vertices[:, 2].max(), abs=0.02)
    view = "--view", "fixed", "--size", "320x180"
    for name, flags in (("own.png", ()), ("scanned.png", ("--surface", scan))):
        result = film(sample_out, "-o", tmp_path / name, *view, *flags)
        assert result.returncode == 0, result.stderr
    own, scanned_picture = (cv2.imread(str(tmp_path / name)).astype(int) for name in ("own.png", "scanned.png"))
    assert (np.abs(own - scanned_picture).max(axis=2) > 30).sum() > 20
    trimesh.Trimesh(head.vertices, head.faces[:-3], process=False).export(scan / "head.obj")
    result = film(sample_out, "-o", tmp_path / "open.png", "--surface", scan)
    assert result.returncode == 1
    assert "the surface of head is not closed" in " ".join(result.stderr.split())
    assert not (tmp_path / "open.png").exists()


def test_each_row_of_a_rolling_shutter_has_its_own_pose(sample: Path, sample_out: Path) -> None:
    """The sample as if its rows were read out over 12 ms: rows are drawn by the poses of their times."""
    solved = read_solved_body(sample_out)
    frames = RecordedFrames(sample / "sample" / "bag", solved, "foot_right", "--view")
    frames.readout_s = 0.012
    motion = FilmedMotion(solved, frames)
    shots = CameraShots(frames, solved, motion.world_T_segment, None, SIZE)
    bands = shots.bands(30, motion)
    _, top, _, height = shots.window
    assert [band.top for band in bands] == [0 + top, *(band.bottom for band in bands[:-1])]
    assert bands[-1].bottom == top + height
    mount = solved.body.mounts["foot_right"]
    for band in bands:
        middle = (0.5 * (band.top + band.bottom) - top) / height
        at_ns = int(frames.stamps_ns[30] + 12e6 * (middle - 0.5))
        pose = solved.segments_near(at_ns)[solved.body.segment_index["foot_right"]] @ mount.segment_T_camera
        np.testing.assert_allclose(band.world_T_camera, pose, atol=2e-3)
    assert np.linalg.norm(bands[0].world_T_camera[:3, 3] - bands[-1].world_T_camera[:3, 3]) > 5e-3, "the foot moves"
    frames.readout_s = 0.0
    assert CameraShots(frames, solved, motion.world_T_segment, None, SIZE).bands(30, motion) == []

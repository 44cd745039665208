"""The video: who looks at it sees the body where it is, in the colours of its sides."""

from pathlib import Path

import av
import numpy as np
import pytest
from known_walk import FRAME_NS, START_NS, Walk, write_solved
from numpy.typing import NDArray
from unshown_progress import Unshown

from bodycam_ros.body.body_file import read_body
from bodycam_ros.cli.main import main
from bodycam_ros.drawing.picture_style import CENTRE, LEFT, RIGHT
from bodycam_ros.errors import ViewError
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.view.film import HEIGHT, WIDTH, looking_at, write_film
from bodycam_ros.view.motion import Motion
from bodycam_ros.view.opening_view import FIELD_OF_VIEW, OpeningView, points_to_see
from bodycam_ros.view.scene_nodes import rgb
from bodycam_ros.view.skeleton_scene import limbs_of
from bodycam_ros.view.sources import Sources

_SHADED = 0.12  # of the whole range of a hue's channels


def pictures(path: Path) -> list[NDArray[np.uint8]]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def share(picture: NDArray[np.uint8], pixels: NDArray[np.float64], colour: str) -> float:
    """Share of pixels (N, 2) that show a colour, lit from anywhere."""
    columns, rows = np.round(pixels).astype(int).T
    seen = picture[rows, columns].astype(float)
    wanted = np.array(rgb(colour), float)
    brightness = (seen @ wanted) / (wanted @ wanted)
    off = np.abs(seen - brightness[:, None] * wanted).max(axis=1) / 255.0
    return float(np.mean((off < _SHADED) & (brightness > 0.4) & (brightness < 1.3)))


def test_the_body_walks_through_the_video_in_its_colours(sample: Path, body_file: Path, tmp_path: Path) -> None:
    body = read_body(sample / "body.yaml")
    poses = np.stack([Motion.standing(body).segments_at(body, 0)] * 3)
    poses[:, :, 0, 3] += 0.3 * np.arange(3)[:, None]
    stamps = START_NS + FRAME_NS * np.arange(3, dtype=np.int64)
    out = write_solved(Walk(body, stamps, poses), tmp_path / "out")
    sources = Sources.read(out, sample / "map", body_file, None)
    write_film(sources, None, tmp_path / "film.mp4", Unshown())
    film = pictures(tmp_path / "film.mp4")
    assert [picture.shape for picture in film] == [(HEIGHT, WIDTH, 3)] * 3
    opening = OpeningView.of_body(poses[0, 0], points_to_see(body, capsule_surfaces(body), poses[0]))
    camera = looking_at(opening.position, opening.look_at)
    focal = HEIGHT / 2.0 / np.tan(FIELD_OF_VIEW / 2.0)
    along = np.linspace(0.25, 0.75, 9)[:, None]
    for side, colour in (("_left", LEFT), ("_right", RIGHT), ("head", CENTRE)):
        limbs = [limb for limb in limbs_of(body, poses[0]) if limb.segment.endswith(side)]
        points = np.concatenate([(1.0 - along) * limb.start + along * limb.end for limb in limbs])
        x, y, z = camera[:3, :3].T @ (points - camera[:3, 3]).T
        pixels = np.stack([x, y], axis=1) * (focal / z)[:, None] + [WIDTH / 2.0, HEIGHT / 2.0]
        assert share(film[0], pixels, colour) > 0.8, side
    empty = np.array([[20.0, 20.0], [WIDTH - 20.0, 20.0]])
    assert share(film[0], empty, LEFT) == 0.0


def test_a_camera_has_its_images_under_the_body(
    sample: Path, sample_out: Path, body_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def bodycam_view(*arguments: str | Path) -> tuple[int, str, str]:
        code = main(["view", *map(str, arguments)])
        return code, *capsys.readouterr()

    given = ["--map", sample / "map", "--body", body_file, "--recording", sample / "sample" / "bag"]
    video = tmp_path / "film.mp4"
    code, said, _ = bodycam_view(sample_out, *given, "--video", video, "--from", "foot_left")
    assert (code, said) == (0, f"video written to {video}\n")
    film = pictures(video)
    assert len(film) == 60 and film[0].shape == (960, 1280, 3)
    blue = film[30].astype(int)[..., 2] - film[30].astype(int)[..., 0] > 40
    assert blue[700:, 1000:].mean() > 0.3  # its own shin, at the edge where the camera is strapped beside it
    assert blue[:500].mean() < 0.01  # and the room as the camera saw it: grey
    assert film[30][200:500, 200:1000].std() > 10.0

    for arguments, reason in (
        ((sample_out, *given, "--video", video), "--force"),
        ((sample_out, *given, "--from", "nose"), "is for --video"),
        ((sample_out, *given, "--video", tmp_path / "x.mp4", "--from", "nose"), "there are waist_front"),
        ((*given[:4], "--video", tmp_path / "x.mp4"), "does not move"),
        ((sample_out, *given, "--video", body_file), "which it must not touch"),
    ):
        code, _, complaint = bodycam_view(*arguments)
        assert code == 1 and reason in complaint
    assert not (tmp_path / "x.mp4").exists()


def test_a_camera_without_a_recording_leaves_no_video(
    sample_out: Path, sample: Path, body_file: Path, tmp_path: Path
) -> None:
    sources = Sources.read(sample_out, sample / "map", body_file, None)
    with pytest.raises(ViewError, match="with --recording"):
        write_film(sources, "head", tmp_path / "x.mp4", Unshown())
    assert list(tmp_path.glob("*.mp4")) == []

"""Boards as PDF pages, drawn by a renderer that is not ours and read by OpenCV's own detectors."""

from dataclasses import dataclass

import cv2
import numpy as np
import pypdfium2
import pytest

from bodycam_ros.boards.board import read_board
from bodycam_ros.boards.board_design import read_layout
from bodycam_ros.cli.board import PAGES
from bodycam_ros.cli.main import main

_PIXELS_PER_MM = 6.0
_POINTS_PER_MM = 72.0 / 25.4
_CLOSE_MM = 0.05  # 0.3 pixels


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """Kind and page -> the board's YAML file and its page as a ``Drawn``, of boards that are drawn once."""
    folder = tmp_path_factory.mktemp("boards")
    made = {}

    def get(kind, page="A4", *words):
        key = (kind, page, *words)
        if key not in made:
            pdf = folder / f"{len(made)}.pdf"
            assert main(["board", "-o", str(pdf), "--kind", kind, "--page", page, *words]) == 0
            made[key] = (pdf.with_suffix(".yaml"), _drawn(pdf))
        return made[key]

    return get


@dataclass(frozen=True)
class Drawn:
    """A page as pixels, and how many there are to a millimetre to the right and down.

    The renderer stretches a page to whole pixels.
    """

    picture: np.ndarray
    per_mm: np.ndarray

    def millimetres(self, pixels):
        """Right and up on the page (N, 2); the centre of the upper left pixel is (0, 0)."""
        return (np.reshape(pixels, (-1, 2)) + 0.5) / self.per_mm * [1.0, -1.0]


def _drawn(pdf):
    document = pypdfium2.PdfDocument(pdf)
    assert len(document) == 1
    size_mm = np.array(document[0].get_size()) / _POINTS_PER_MM
    picture = document[0].render(scale=_PIXELS_PER_MM / _POINTS_PER_MM, grayscale=True).to_numpy().squeeze()
    return Drawn(picture, picture.shape[::-1] / size_mm)


def _off_by_mm(found_mm, corners_m):
    """Largest distance after a shift alone: neither turn nor scale is made up for."""
    off = found_mm - 1e3 * np.reshape(corners_m, (-1, np.shape(corners_m)[-1]))[:, :2]
    return np.abs(off - off.mean(axis=0)).max()


def _tags(picture):
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    found, tags, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(picture)
    return {int(tag): corners.reshape(4, 2) for tag, corners in zip(tags.ravel(), found, strict=True)}


@pytest.mark.parametrize("page", ["A4", "A3", "letter"])
def test_tags_are_where_the_map_reads_them_to_be(printed, page):
    path, drawn = printed("apriltag", page)
    assert drawn.picture.shape[::-1] / drawn.per_mm == pytest.approx(PAGES[page], abs=1e-3)
    board = read_board(path)
    tags = _tags(drawn.picture)
    assert set(tags) == set(board.corners_board) == set(range(6))
    found = np.concatenate([drawn.millimetres(tags[tag]) for tag in sorted(tags)])
    assert _off_by_mm(found, [board.corners_board[tag] for tag in sorted(tags)]) < _CLOSE_MM
    assert np.allclose(board.map_R_board, np.eye(3))


def test_opencv_knows_the_charuco_board(printed):
    path, drawn = printed("charuco")
    layout = read_layout(path)
    board = cv2.aruco.CharucoBoard(
        (layout.columns, layout.rows),
        layout.pitch_m[0],
        layout.tag_m[0],
        cv2.aruco.getPredefinedDictionary(layout.dictionary),
    )
    corners, numbers, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(drawn.picture)
    assert numbers.ravel().tolist() == list(range(len(layout.inner_corners)))
    assert _off_by_mm(drawn.millimetres(corners), layout.inner_corners) < _CLOSE_MM
    # The same file gives a map its scale.
    assert set(read_board(path).corners_board) == set(layout.tags) == set(range(20))


def test_the_checkerboard_is_one(printed):
    path, drawn = printed("checkerboard", "letter")
    layout = read_layout(path)
    found, corners = cv2.findChessboardCornersSB(drawn.picture, (layout.columns - 1, layout.rows - 1))
    assert found
    corners = drawn.millimetres(corners)
    if corners[0, 0] > corners[-1, 0]:
        corners = corners[::-1]
    assert _off_by_mm(corners, layout.inner_corners) < _CLOSE_MM


def test_rulers_that_no_print_has_are_an_error_and_nothing_is_written(tmp_path, capsys):
    assert main(["board", "-o", str(tmp_path / "board.pdf"), "--ruler-mm", "120", "150"]) == 1
    assert "no print of it measures" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())

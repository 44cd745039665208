"""A board to print, as large as the paper allows, and the file that describes a board.

``docs/board.md`` explains the fields. A map needs ``corners_in_board``; for a lens the measures are enough, so that the
file of a board that was bought is written in a minute.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from bodycam_ros.boards.board import read_board
from bodycam_ros.boards.board_layout import APRILTAG, CHARUCO, CHECKERBOARD, KINDS, BoardLayout, tags_in
from bodycam_ros.errors import LensError
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.files.yaml_file import read_yaml

MARK = "# board of bodycam"
"""How the files that are written begin."""

_MOST_SQUARES = 100  # of columns and of rows

_COUNTS = {APRILTAG: (3, 2), CHARUCO: (8, 5), CHECKERBOARD: (10, 7)}
"""Columns and rows, for paper on its long side; an even and an odd number give a checkerboard an orientation."""

_FAMILY = "36h11"  # of printed tags
_LARGEST_M = 100.0
_UPPER_LEFT = ("black", "white")
_GAP_OF_TAG = 0.25
_TAG_OF_SQUARE = 0.75  # leaves a tag an eighth of the square on either side, in which edges are searched


def dictionaries() -> dict[str, int]:
    """Families of tags in ``cv2.aruco``: 36h11 and the other AprilTags, 5X5_100 and the other ArUcos."""
    # Some have two names; the one with small letters, which comes last, is that of the map's boards.
    names = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    of_number = {int(getattr(cv2.aruco, n)): n.removeprefix("DICT_").removeprefix("APRILTAG_") for n in names}
    return {name: number for number, name in of_number.items()}


def board_yaml(layout: BoardLayout, placement: str) -> str:
    """The text of a board's file, which ``read_layout`` and, if it has tags, ``mapping.board.read_board`` read."""
    document: dict[str, Any] = {"kind": layout.kind}
    if layout.dictionary is not None:
        document["family"] = next(n for n, number in dictionaries().items() if number == layout.dictionary)
        document["first_tag"] = layout.first_tag
    document |= {"columns": layout.columns, "rows": layout.rows}
    if layout.kind != APRILTAG:
        document["square_size_m"] = _sides(layout.pitch_m)
        document["upper_left"] = _UPPER_LEFT[not layout.upper_left_is_black]
    if layout.kind != CHECKERBOARD:
        document["tag_size_m"] = _sides(layout.tag_m)
    if layout.kind == APRILTAG:
        document["gap_m"] = _sides(tuple(np.subtract(layout.pitch_m, layout.tag_m).tolist()))
    document["placement"] = placement
    head = (
        f"{MARK}; corners in the order of cv2.aruco (from the upper left, clockwise),\n"
        "# board frame x right, y to the top row, z out of the face, origin in the middle [m]\n"
    )
    text = head + yaml.safe_dump(document, sort_keys=False)
    if layout.tags:
        corners = {tag: np.round(corners_tag, 7).tolist() for tag, corners_tag in layout.tags.items()}
        text += yaml.safe_dump({"corners_in_board": corners}, default_flow_style=None, width=120)
    return text


def read_layout(path: Path) -> BoardLayout:
    """What is on a board that a lens is to be measured by; of a file with corners of tags, these alone.

    Raises:
        LensError: the file lacks a measure, or has one that no board has.
        MapError: it has corners that make no tags.
    """
    document = read_yaml(path, "board description", LensError)
    if not isinstance(document, Mapping):
        raise LensError(f"{path}: expected a board description with kind, columns, rows and so on; see docs/board.md")
    kind = document.get("kind", APRILTAG)
    if kind not in KINDS:
        raise LensError(f"{path}: there is no kind of board {shown(kind)}; {other_than(kind, KINDS)}")
    if kind == APRILTAG and "corners_in_board" in document:
        board = read_board(path)
        family = dictionaries()[board.family]
        return BoardLayout(kind, 1, 1, (0.0, 0.0), dictionary=family, given_tags=board.corners_board)
    try:
        return _layout(kind, document)
    except LensError as error:
        raise LensError(f"{path}: {error}") from error


def _layout(kind: str, document: Mapping[Any, Any]) -> BoardLayout:
    upper_left, first = document.get("upper_left", _UPPER_LEFT[0]), document.get("first_tag", 0)
    if upper_left not in _UPPER_LEFT:
        raise LensError(f"'upper_left' must be black or white, not {shown(upper_left)}")
    if type(first) is not int or first < 0:
        raise LensError(f"'first_tag' must be a whole number from 0, not {shown(first)}")
    counts: list[Any] = [document.get(name) for name in ("columns", "rows")]
    for name, value in zip(("columns", "rows"), counts, strict=True):
        if type(value) is not int or not 1 <= value <= _MOST_SQUARES:
            raise LensError(f"'{name}' must be a whole number from 1 to {_MOST_SQUARES}, not {shown(value)}")
    if kind == CHECKERBOARD:
        return _checked(BoardLayout(kind, counts[0], counts[1], _lengths(document, "square_size_m")), "")
    tag = _lengths(document, "tag_size_m")
    beside = _lengths(document, "gap_m" if kind == APRILTAG else "square_size_m")
    pitch = (tag[0] + beside[0], tag[1] + beside[1]) if kind == APRILTAG else beside
    family = str(document.get("family"))
    return _checked(BoardLayout(kind, counts[0], counts[1], pitch, tag, None, first, upper_left == "black"), family)


def _checked(layout: BoardLayout, family: str) -> BoardLayout:
    """The board, with tags of a family.

    Raises:
        LensError: there is no such board.
    """
    if layout.kind != APRILTAG and min(layout.columns, layout.rows) < 3:
        raise LensError(f"a {layout.kind} board has 3 columns and rows or more, not {layout.columns} x {layout.rows}")
    if layout.kind == CHECKERBOARD:
        return layout
    if family not in dictionaries():
        known = ", ".join(sorted(dictionaries()))
        raise LensError(f"there is no family of tags {shown(family)}; known are {known}")
    if layout.kind == CHARUCO and np.greater_equal(layout.tag_m, layout.pitch_m).any():
        raise LensError(
            f"tags of {1e3 * layout.tag_m[0]:g} mm do not fit into squares of {1e3 * layout.pitch_m[0]:g} mm: "
            "tag_size_m must be less than square_size_m"
        )
    layout = replace(layout, dictionary=dictionaries()[family])
    there, last = tags_in(dictionaries()[family]), max(layout.tags)
    if last >= there:
        raise LensError(
            f"tags {layout.first_tag} to {last} are wanted, but the family {family} ends with {there - 1}; take fewer, "
            "or another family"
        )
    return layout


def _sides(lengths: tuple[float, ...]) -> float | list[float]:
    across, up = (round(length, 7) for length in lengths)
    return across if across == up else [across, up]


def _lengths(document: Mapping[Any, Any], name: str) -> tuple[float, float]:
    """One length, or one across and one upwards, of a printer that stretches [m]."""
    value = document.get(name)
    values: list[Any] = value if isinstance(value, list) else [value, value]
    if len(values) != 2 or not all(type(v) in (int, float) and 0.0 < v < _LARGEST_M for v in values):
        raise LensError(
            f"'{name}' must be a length [m] above 0, or two of them (to the right, upwards), not {shown(value)}"
        )
    return float(values[0]), float(values[1])


def design_layout(kind: str, width_mm: float, height_mm: float) -> BoardLayout:
    """The board of a kind that fills an area of paper, in whole millimetres."""
    columns, rows = _COUNTS[kind]
    gaps = _GAP_OF_TAG if kind == APRILTAG else 0.0
    side_mm = min(width_mm / (columns + gaps * (columns - 1)), height_mm / (rows + gaps * (rows - 1)))
    side = 1e-3 * float(np.floor(side_mm) if side_mm >= 1.0 else side_mm)
    pitch, tag = (side * (1.0 + gaps), side) if kind == APRILTAG else (side, _TAG_OF_SQUARE * side)
    tags = (0.0, 0.0) if kind == CHECKERBOARD else (tag, tag)
    return _checked(BoardLayout(kind, columns, rows, (pitch, pitch), tags), _FAMILY)


def scale_layout(layout: BoardLayout, share: tuple[float, float]) -> BoardLayout:
    """The board as a printer made it: by these shares larger to the right and upwards."""
    pitch, tag = (np.multiply(size, share).tolist() for size in (layout.pitch_m, layout.tag_m))
    return replace(layout, pitch_m=tuple(pitch), tag_m=tuple(tag))


def board_caption(layout: BoardLayout) -> str:
    """What is printed beneath a board, for who finds it."""
    parts = f"{layout.columns} x {layout.rows}"
    pitch, tag = f"{1e3 * layout.pitch_m[0]:g} mm", f"{1e3 * layout.tag_m[0]:g} mm"
    if layout.kind == CHECKERBOARD:
        return f"checkerboard, {parts} squares of {pitch}"
    tags = f"{_FAMILY}, {min(layout.tags)} to {max(layout.tags)}"
    if layout.kind == CHARUCO:
        return f"ChArUco, {parts} squares of {pitch}, tags of {tag} ({tags})"
    return f"AprilTags, {parts} of {tag}, {pitch} apart from middle to middle ({tags})"

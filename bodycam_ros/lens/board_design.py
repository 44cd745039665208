"""A board to print: as large as the paper allows, or of the size that was asked for."""

from dataclasses import dataclass, replace

import numpy as np

from bodycam_ros.errors import LensError
from bodycam_ros.lens.board_layout import APRILTAG, CHARUCO, CHECKERBOARD, BoardLayout
from bodycam_ros.lens.board_page import Room
from bodycam_ros.lens.board_yaml import check_tags, dictionaries

COUNTS = {APRILTAG: (3, 2), CHARUCO: (8, 5), CHECKERBOARD: (10, 7)}
"""Columns and rows, for paper on its long side; an even and an odd number tell how a checkerboard is turned."""

_GAP_OF_TAG = 0.25
_TAG_OF_SQUARE = 0.75  # leaves a tag an eighth of the square on either side, which edges are looked for in


@dataclass(frozen=True)
class BoardWish:
    """What a board is to be like; None where the paper decides.

    Attributes:
        kind: of ``KINDS``.
        columns, rows: of tags, or of squares.
        tag_mm, square_mm: sides [mm].
        family: of the tags, as ``dictionaries`` names it.
        first_tag: number of the upper left tag.
    """

    kind: str
    columns: int | None = None
    rows: int | None = None
    tag_mm: float | None = None
    square_mm: float | None = None
    family: str = "36h11"
    first_tag: int = 0


def design(wish: BoardWish, room: Room) -> BoardLayout:
    """The board that is wished, in whole millimetres where the paper decides.

    Raises:
        LensError: the wish contradicts itself.
    """
    kind = wish.kind
    columns, rows = wish.columns or COUNTS[kind][0], wish.rows or COUNTS[kind][1]
    if kind == CHECKERBOARD:
        if wish.tag_mm is not None:
            raise LensError("a checkerboard has no tags; say with --square-size how large its squares are")
        if min(columns, rows) < 3 or columns % 2 == rows % 2:
            raise LensError(
                f"a checkerboard of {columns} x {rows} squares does not tell how it is turned; of columns and rows one "
                "must be even and the other odd, both 3 or more"
            )
        side = _side(wish.square_mm, room, columns, rows)
        return BoardLayout(kind, columns, rows, (side, side))
    if wish.family not in dictionaries():
        known = ", ".join(sorted(dictionaries()))
        raise LensError(f"there is no family of tags '{wish.family}'; known are {known}")
    if kind == APRILTAG:
        if wish.square_mm is not None:
            raise LensError("a board of AprilTags has no squares; say with --tag-size how large its tags are")
        gaps = _GAP_OF_TAG * np.array([columns - 1, rows - 1])
        tag = _side(wish.tag_mm, room, *(np.array([columns, rows]) + gaps).tolist())
        pitch = tag * (1.0 + _GAP_OF_TAG)
    else:
        if min(columns, rows) < 3:
            raise LensError(f"a ChArUco board has 3 columns and rows or more, not {columns} x {rows}")
        pitch = _side(wish.square_mm, room, columns, rows)
        tag = _TAG_OF_SQUARE * pitch if wish.tag_mm is None else 1e-3 * wish.tag_mm
        if tag >= pitch:
            raise LensError(f"tags of {1e3 * tag:g} mm do not fit into squares of {1e3 * pitch:g} mm")
    dictionary = dictionaries()[wish.family]
    layout = BoardLayout(kind, columns, rows, (pitch, pitch), (tag, tag), dictionary, wish.first_tag)
    check_tags(layout, wish.family, "the board")
    return layout


def stretched(layout: BoardLayout, share: tuple[float, float]) -> BoardLayout:
    """The board as a printer made it: by these shares larger to the right and upwards."""
    pitch, tag = (np.multiply(size, share).tolist() for size in (layout.pitch_m, layout.tag_m))
    return replace(layout, pitch_m=tuple(pitch), tag_m=tuple(tag))


def board_words(layout: BoardLayout, family: str) -> str:
    """What is printed beneath a board, for who finds it."""
    parts = f"{layout.columns} x {layout.rows}"
    pitch, tag = f"{1e3 * layout.pitch_m[0]:g} mm", f"{1e3 * layout.tag_m[0]:g} mm"
    if layout.kind == CHECKERBOARD:
        return f"checkerboard, {parts} squares of {pitch}"
    tags = f"{family}, {min(layout.tags)} to {max(layout.tags)}"
    if layout.kind == CHARUCO:
        return f"ChArUco, {parts} squares of {pitch}, tags of {tag} ({tags})"
    return f"AprilTags, {parts} of {tag}, {pitch} apart from middle to middle ({tags})"


def _side(wished_mm: float | None, room: Room, across: float, upwards: float) -> float:
    """Of a part [m] of which so many make the board's width and height."""
    if wished_mm is not None:
        return 1e-3 * wished_mm
    side_mm = min(room.width / across, room.height / upwards)
    return 1e-3 * float(np.floor(side_mm) if side_mm >= 1.0 else side_mm)

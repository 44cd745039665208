"""Whether a file of static cameras is another program's; without NumPy, which a launch file does not load."""

from pathlib import Path

_MOST_BYTES = 100_000
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_MARKS = (b"camera_model:", b"intrinsics:")
_OURS = (b"T_map_cam", b"T_board_cam")


def is_other_calibration(path: Path) -> bool:
    """Whether a file is one of another program: by its name, its first line, or the fields of Kalibr's camchain."""
    if path.name.endswith((".toml", ".qca.txt")):
        return True
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            start = file.read(_MOST_BYTES).removeprefix(_BYTE_ORDER_MARK)
    except OSError:
        return False
    return start.startswith(b"%YAML") or (
        all(mark in start for mark in _MARKS) and not any(mark in start for mark in _OURS)
    )

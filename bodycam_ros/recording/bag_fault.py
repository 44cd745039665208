"""What is wrong with a file that should have been a ROS 2 bag."""

from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.yaml_file import read_yaml

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER_LENGTH = 29  # opcode, length, two offsets, checksum; the magic follows
_HEADER_OPCODE, _FOOTER_OPCODE = 0x01, 0x02
_STORAGE_SUFFIXES = (".mcap", ".db3")

METADATA = "metadata.yaml"
"""Of a bag folder: its topics, and how many messages each has."""


def check_files(path: Path) -> None:
    """Refuse what would keep a reader waiting, or fill its memory, before it is opened.

    Raises:
        RecordingError: a pipe or device in the place of a bag's file, metadata that no recorder writes, or a path that
            the system refuses.
    """
    files = [path]
    try:
        if path.is_dir():
            files = [file for file in path.iterdir() if file.suffix in _STORAGE_SUFFIXES]
            if (metadata := path / METADATA).exists():
                read_yaml(metadata, "bag's metadata", RecordingError)
        for file in files:
            if file.exists() and not file.is_file():
                raise RecordingError(f"{file}: is a folder, pipe or device, not a bag's file")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error


def fault_of(path: Path) -> str | None:
    """Say in the user's words why a bag cannot be read, and what to do; None if it looks well from here."""
    if not path.exists():
        return "does not exist"
    if path.is_file():
        if path.suffix == ".mcap":
            return _mcap_fault(path)
        return None if path.suffix in _STORAGE_SUFFIXES else "is not a bag; expected a ros2 bag folder or an .mcap file"
    files = sorted(f for f in path.iterdir() if f.suffix in _STORAGE_SUFFIXES)
    if not (path / METADATA).exists():
        if files:
            return f"has no metadata.yaml; give the file itself ({files[0].name}), or run 'ros2 bag reindex'"
        return "is not a ros2 bag folder: it holds neither metadata.yaml nor an .mcap file"
    for file in files:
        fault = _mcap_fault(file) if file.suffix == ".mcap" else None
        if fault:
            return f"{file.name} {fault}"
    return None


def _mcap_fault(path: Path) -> str | None:
    """Check the frame of an MCAP file: magic, header's profile, footer, magic."""
    with path.open("rb") as file:
        start = file.read(4096)
        size = file.seek(0, 2)
        file.seek(max(0, size - _FOOTER_LENGTH - len(_MAGIC)))
        end = file.read()
    if not start:
        return "is empty"
    if not start.startswith(_MAGIC):
        return "is not an MCAP file (it does not begin as one)"
    if len(end) != _FOOTER_LENGTH + len(_MAGIC) or not end.endswith(_MAGIC) or end[0] != _FOOTER_OPCODE:
        return (
            "is cut off: it ends without MCAP's footer, as when the recorder was killed or a copy broke off; "
            "'mcap recover' saves what is there"
        )
    profile = _profile(start)
    if profile is not None and profile != "ros2":
        return f"is MCAP, but not from ROS 2: its profile is '{profile}', expected 'ros2'; convert it to a ros2 bag"
    return None


def _profile(start: bytes) -> str | None:
    """The profile in the header record, if there is such a record."""
    at = len(_MAGIC)
    if len(start) < at + 13 or start[at] != _HEADER_OPCODE:
        return None
    length = int.from_bytes(start[at + 9 : at + 13], "little")
    return start[at + 13 : at + 13 + length].decode(errors="replace")

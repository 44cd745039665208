"""Text files of other programs: their encodings, the ends of their lines, and a last row that a copy cut off."""

import codecs
import logging
from collections.abc import Sequence
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.files.yaml_file import read_bytes
from bodycam_ros.formats.captured_motion import MOST_BYTES

logger = logging.getLogger(__name__)


def read_foreign(path: Path, what: str) -> str:
    """The text of a file, with a line feed at the end of each line.

    It is UTF-8, UTF-16 where it says so, or else Windows' Western European, which older programs write names in.

    Raises:
        RecordingError: it cannot be read.
    """
    content = read_bytes(path, what, RecordingError, MOST_BYTES)
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = content.decode("utf-16", "replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("cp1252", "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def is_last_row_cut(path: Path, text: str, widths: Sequence[int]) -> bool:
    """Whether the last row of a table was cut off, with a warning that it is left out.

    No line feed ends it, and it has fewer cells than each other row: its last number may lack digits.

    Args:
        path: of the file, for the warning.
        text: the whole file.
        widths: cells of each row.
    """
    if len(widths) < 2 or text.endswith("\n") or widths[-1] >= min(widths[:-1]):
        return False
    logger.warning("%s: ends within its last row, which is left out; copy or export it again if that row matters", path)
    return True

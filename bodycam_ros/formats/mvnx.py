"""Xsens MVN's MVNX: XML with position and orientation of 23 segments a frame, of a world with z up, in metres."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from bodycam_ros.files.shown import shown
from bodycam_ros.formats.captured_motion import MOST_BYTES, CapturedMotion, checked_stamps
from bodycam_ros.geometry import Array, rotation_from_xyzw

_PROLOG = 65_536
_POSES = ("identity", "tpose", "tpose-isb", "npose")
"""Types of frames that are no part of the motion."""


def read_mvnx(path: Path) -> CapturedMotion:
    """Segments by label, with rotations; time counts from the first frame of the motion.

    Raises:
        ValueError: it cannot be read, or is no MVNX.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ValueError(f"it has more than {MOST_BYTES // 1_000_000} MB")
        with path.open("rb") as file:
            if b"<!ENTITY" in file.read(_PROLOG):
                raise ValueError("its <!DOCTYPE> has entities, which could stand for any length; remove them")
        labels, rate, positions, quaternions = _content(path)
    except (OSError, ElementTree.ParseError) as error:
        raise ValueError(str(error)) from error
    count = len(labels)
    if not count or not rate > 0.0:
        raise ValueError("expected <subject frameRate=...> with <segments> before its frames")
    for what, rows, each in (("position", positions, 3), ("orientation", quaternions, 4)):
        for number, row in enumerate(rows, 1):
            if len(row) != each * count:
                raise ValueError(f"frame {number}: {what} has {len(row)} numbers, expected {each} to a segment")
    if len(positions) != len(quaternions) or not positions:
        raise ValueError("expected position and orientation in each frame; export them in MVN")
    places = np.array(positions).reshape(-1, count, 3)
    q = np.array(quaternions).reshape(-1, count, 4)
    if not np.isfinite(places).all() or not np.isfinite(q).all():
        raise ValueError("positions and orientations must be finite")
    R = rotation_from_xyzw(q[..., [1, 2, 3, 0]])  # w first in the file
    points: dict[str, Array] = {label: places[:, k] for k, label in enumerate(labels)}
    rotations: dict[str, Array] = {label: np.ascontiguousarray(R[:, k]) for k, label in enumerate(labels)}
    return CapturedMotion(path, "MVNX", checked_stamps(np.arange(len(places)) / rate), points, rotations)


def _content(path: Path) -> tuple[list[str], float, list[list[float]], list[list[float]]]:
    """Labels of segments, frames a second, and positions and quaternions of each frame of the first subject."""
    labels: list[str] = []
    positions, quaternions = list[list[float]](), list[list[float]]()
    rate = 0.0
    within: list[ElementTree.Element] = []
    for event, element in ElementTree.iterparse(path, ("start", "end")):
        tag = element.tag.rpartition("}")[2]
        if event == "start":
            within.append(element)
            if tag == "subject" and not rate:
                rate = _number(element.get("frameRate", ""))
            elif tag == "segment" and _has_tag(within[-2:-1], "segments"):
                labels.append(element.get("label", f"segment {len(labels) + 1}"))
            continue
        within.pop()
        if tag == "frame":
            if element.get("type", "normal").lower() not in _POSES:
                values = {child.tag.rpartition("}")[2]: child.text or "" for child in element}
                for key, rows in (("position", positions), ("orientation", quaternions)):
                    if key in values:
                        rows.append([_number(word) for word in values[key].split()])
            element.clear()
        elif tag == "subject":
            break  # another subject is another motion
        elif within and within[-1].tag.rpartition("}")[2] == "frames":
            element.clear()
    if len(set(labels)) < len(labels):
        raise ValueError("two segments have the same label")
    return labels, rate, positions, quaternions


def _has_tag(elements: list[ElementTree.Element], tag: str) -> bool:
    return any(element.tag.rpartition("}")[2] == tag for element in elements)


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError as error:
        raise ValueError(f"{shown(word)} is no number") from error

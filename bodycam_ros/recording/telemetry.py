"""The satellites' time in a GoPro's telemetry (GPMF): which time of day it was at a media time.

GPMF is nested records: a name of four letters, a type, the size of an element, how many there are, and the elements,
filled up to four bytes. Payloads come about once a second. A firmware may write anything, so what does not fit is
passed over.
"""

import struct
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

from av.error import FFmpegError

from bodycam_ros.recording.video_file import only, opened

_HEADER = struct.Struct(">4sBBH")
_NESTED = 0
_DEEPEST = 6
_MOST_PAYLOADS = 600
"""Ten minutes of them say it as well as two hours."""

_WITH_FIX = 2
"""Less, and the time is the camera's own clock."""

_GPS9 = struct.Struct(">7i2H")
_GPS9_DAY, _GPS9_SECOND, _GPS9_FIX = 5, 6, 8
_SINCE = datetime(2000, 1, 1, tzinfo=UTC)


def satellite_times(path: Path) -> list[tuple[float, float]]:
    """Media time [s] and UTC [s since 1970] of the payloads whose satellites had a fix; none without telemetry.

    Raises:
        RecordingError: the file cannot be opened.
    """
    times: list[tuple[float, float]] = []
    with opened(path) as container:
        streams = container.streams.data
        if not streams:
            return times
        # All in one pass, which reads the file once: cameras write tracks of other data (tmcd) before GPMF.
        only(container, *streams)
        packets, payloads = container.demux(*streams), 0
        while payloads < _MOST_PAYLOADS:
            try:
                packet = next(packets, None)
            except (FFmpegError, ValueError):
                break
            if packet is None:
                break
            if packet.pts is None or not packet.size:
                continue
            content = bytes(packet)
            if not content.startswith(b"DEVC"):
                continue
            payloads += 1
            if (utc_s := _time_in(content)) is not None:
                times.append((float(packet.pts * (packet.time_base or 0)), utc_s))
    return times


def _time_in(payload: bytes) -> float | None:
    """UTC of the first satellite reading in a payload, if there was a fix."""
    fix, said = None, None
    for name, size, content in _records(payload, 0):
        if name == b"GPSF" and len(content) >= 4:
            fix = int.from_bytes(content[:4], "big")
        elif name == b"GPSU":
            said = _gpsu(content[:16])
        elif name == b"GPS9" and size == _GPS9.size and len(content) >= size:
            values = _GPS9.unpack_from(content)
            if values[_GPS9_FIX] >= _WITH_FIX:
                return _timestamp(_SINCE, values[_GPS9_DAY], values[_GPS9_SECOND])
    return said if fix is not None and fix >= _WITH_FIX else None


def _records(content: bytes, depth: int) -> Iterator[tuple[bytes, int, bytes]]:
    """Name, element's size and content of all records that hold no others."""
    at = 0
    while at + _HEADER.size <= len(content) and depth < _DEEPEST:
        name, kind, size, repeat = _HEADER.unpack_from(content, at)
        at += _HEADER.size
        inner = content[at : at + size * repeat]
        if name == bytes(4):
            return
        if kind == _NESTED:
            yield from _records(inner, depth + 1)
        else:
            yield name, size, inner
        at += -(-size * repeat // 4) * 4


def _gpsu(content: bytes) -> float | None:
    """UTC of the text yymmddhhmmss.sss."""
    try:
        text = content.decode("ascii")
        whole = datetime.strptime(text[:12], "%y%m%d%H%M%S").replace(tzinfo=UTC)
        return whole.timestamp() + float(text[12:])
    except ValueError:
        return None


def _timestamp(since: datetime, days: int, milliseconds: int) -> float | None:
    try:
        return (since + timedelta(days=days, milliseconds=milliseconds)).timestamp()
    except OverflowError:
        return None

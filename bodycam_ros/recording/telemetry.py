"""A GoPro's telemetry (GPMF): gyroscope and accelerometer, and whether images are stabilised.

GPMF is nested records: a name of four letters, a type, the size of an element, how many there are, and the elements,
filled up to four bytes. Payloads come about once a second. A firmware may write anything, so what does not fit is
left out.
"""

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.recording.video_file import demuxed, opened

Array = NDArray[np.float64]

_HEADER = struct.Struct(">4sBBH")
_NESTED = 0
_DEEPEST = 6

_DTYPES = {b"s": ">i2", b"S": ">u2", b"l": ">i4", b"L": ">u4", b"f": ">f4", b"J": ">u8"}
_DEFAULT_ORDER = "ZXY"  # of channels, of cameras before the HERO8
_EXCHANGES = (-1.0, 0.0, 1.0)  # elements of a matrix that exchanges or reverses axes
_STABILISED_RAD = np.radians(0.5)  # turn of an image against the camera
_LEAST_RATE_HZ = 90.0  # of a gyroscope; in time-lapse videos samples are averages, about one a frame
_LEAST_SAMPLES = 50
_UNFILLED = 1.25  # times the usual interval of samples, from which on a payload is not filled

Records = Mapping[bytes, tuple[bytes, bytes]]
"""Name -> type and content."""


def inertial_samples(path: Path) -> ImuSamples | None:
    """Gyroscope and accelerometer of a file in media time; None without telemetry of both.

    Axes are near the optical frame: x right, y down, z forward. Times are constantly off by some milliseconds that no
    file has.

    Raises:
        RecordingError: the file cannot be opened, or is a time-lapse.
    """
    found: dict[bytes, list[tuple[float, float, Array]]] = {b"GYRO": [], b"ACCL": []}
    for media_s, end_s, payload in _payloads(path):
        for stream in _streams(payload):
            for name, parts in found.items():
                if name in stream and (values := _vectors(stream, name)) is not None and len(values):
                    parts.append((media_s, end_s, values))
    if any(sum(len(values) for _, _, values in parts) < _LEAST_SAMPLES for parts in found.values()):
        return None
    gyroscope_s, gyroscope = _timed(found[b"GYRO"])
    accelerometer_s, accelerometer = _timed(found[b"ACCL"])
    rate_hz = 1.0 / float(np.median(np.diff(gyroscope_s)))
    if rate_hz < _LEAST_RATE_HZ:
        raise RecordingError(
            f"{path}: its gyroscope has only {rate_hz:.0f} samples per second of video, as in a time-lapse; these are "
            "averages, so its inertial samples are not used"
        )
    at = [np.interp(gyroscope_s, accelerometer_s, axis) for axis in accelerometer.T]
    return ImuSamples(np.round(1e9 * gyroscope_s).astype(np.int64), gyroscope, np.column_stack(at))


def stabilisation(path: Path) -> str:
    """What in a file shows that its images are stabilised electronically; empty if nothing does.

    Raises:
        RecordingError: the file cannot be opened.
    """
    for stream in _streams(_user_data(path)):
        kind, content = stream.get(b"EISE", (b"", b""))
        if kind == b"c" and content[:1] in (b"Y", b"y"):
            return "its setting EISE is on"
    for _, _, payload in _payloads(path):
        for stream in _streams(payload):
            values = _numbers(stream.get(b"IORI", (b"", b"")))
            if values is not None and len(values) >= 4:
                quaternions = values[: len(values) // 4 * 4].reshape(-1, 4)
                norms = np.maximum(np.linalg.norm(quaternions, axis=1), 1e-9)
                turns = 2.0 * np.arccos(np.clip(np.abs(quaternions[:, 0]) / norms, 0.0, 1.0))
                if float(np.median(turns)) > _STABILISED_RAD:
                    return f"images are turned by {np.degrees(np.median(turns)):.1f} deg against the camera"
    return ""


def _payloads(path: Path) -> Iterator[tuple[float, float, bytes]]:
    """Start and end in media time [s] and content of each payload."""
    with opened(path) as container:
        streams = container.streams.data
        if not streams:
            return
        # All in one pass, which reads the file once: cameras write tracks of other data (tmcd) before GPMF.
        for packet in demuxed(container, *streams):
            if packet.pts is None or not packet.size:
                continue
            content = bytes(packet)
            if content.startswith(b"DEVC"):
                unit_s = float(packet.time_base or 0)
                yield packet.pts * unit_s, (packet.pts + (packet.duration or 0)) * unit_s, content


def _user_data(path: Path) -> bytes:
    """Content of the box moov/udta/GPMF of an MP4; empty if there is none."""
    try:
        with path.open("rb") as file:
            return next(_boxes(file, 0, path.stat().st_size, (b"moov", b"udta", b"GPMF")), b"")
    except (OSError, struct.error):
        return b""


def _boxes(file: BinaryIO, at: int, end: int, names: tuple[bytes, ...]) -> Iterator[bytes]:
    """Contents of the boxes of an MP4 that lie within each other by these names."""
    while at + 8 <= end:
        file.seek(at)
        size, name = struct.unpack(">I4s", file.read(8))
        size = struct.unpack(">Q", file.read(8))[0] if size == 1 else size or end - at
        if size < 8:
            return
        if name == names[0]:
            if len(names) == 1:
                yield file.read(min(at + size, end) - file.tell())
            else:
                yield from _boxes(file, file.tell(), min(at + size, end), names[1:])
        at += size


def _streams(content: bytes, depth: int = 0) -> Iterator[Records]:
    """The records of each container that has some that are not nested."""
    at, records = 0, dict[bytes, tuple[bytes, bytes]]()
    while at + _HEADER.size <= len(content) and depth < _DEEPEST:
        name, kind, size, repeat = _HEADER.unpack_from(content, at)
        at += _HEADER.size
        if name == bytes(4):
            break
        inner = content[at : at + size * repeat]
        if kind == _NESTED:
            yield from _streams(inner, depth + 1)
        else:
            records[name] = bytes([kind]), inner
        at += -(-size * repeat // 4) * 4
    if records:
        yield records


def _numbers(record: tuple[bytes, bytes]) -> Array | None:
    kind, content = record
    if kind not in _DTYPES:
        return None
    dtype = np.dtype(_DTYPES[kind])
    return np.frombuffer(content[: len(content) // dtype.itemsize * dtype.itemsize], dtype).astype(np.float64)


def _vectors(stream: Records, name: bytes) -> Array | None:
    """Samples (N, 3) of a sensor in the optical frame's axes, in SI units."""
    values, scale = _numbers(stream[name]), _numbers(stream.get(b"SCAL", (b"s", b"\0\1")))
    if values is None or scale is None or not len(scale) or not scale.all() or len(values) < 3:
        return None
    channels = values[: len(values) // 3 * 3].reshape(-1, 3) / (scale if len(scale) == 3 else scale[0])
    axes, matrix = b"ORIN", _numbers(stream.get(b"MTRX", (b"", b"")))
    if matrix is not None and len(matrix) == 9 and np.isfinite(matrix).all() and not np.isin(matrix, _EXCHANGES).all():
        # As GoPro's parser: from the channels to the axes of ORIO. One that only exchanges axes is left to ORIN.
        axes, channels = b"ORIO", channels @ matrix.reshape(3, 3).T
    order = stream.get(axes, (b"c", _DEFAULT_ORDER.encode()))[1][:3].decode("ascii", "replace")
    if sorted(order.upper()) != ["X", "Y", "Z"]:
        return None
    # Letters name the camera's axes, small ones reversed: X right, Y forward, Z up.
    camera = {letter.upper(): channels[:, k] * (1.0 if letter.isupper() else -1.0) for k, letter in enumerate(order)}
    return np.column_stack([camera["X"], -camera["Z"], camera["Y"]])


def _timed(parts: list[tuple[float, float, Array]]) -> tuple[Array, Array]:
    """Media times (N,) [s], even within each run of payloads without a gap, and samples (N, 3).

    The last payload, and one before a gap, is not filled: its samples have the interval of the others', whatever its
    duration in the container.
    """
    starts_s, counts = np.array([start_s for start_s, _, _ in parts]), np.array([len(values) for _, _, values in parts])
    lengths_s = np.diff(starts_s, append=parts[-1][1])
    lengths_s[lengths_s <= 0.0] = 1.0
    intervals_s = lengths_s / counts
    usual_s = float(np.median(intervals_s))
    intervals_s[intervals_s > _UNFILLED * usual_s] = usual_s
    times = [start + step * np.arange(count) for start, step, count in zip(starts_s, intervals_s, counts, strict=True)]
    rough, samples = np.concatenate(times), np.concatenate([values for _, _, values in parts])
    # Payloads have one sample more or less than others: the sensor's own clock is even.
    index = np.arange(len(rough))
    slope, start = np.polyfit(index, rough, 1)
    even = start + slope * index
    is_even = float(np.abs(even - rough).max()) < 2.0 * float(np.median(np.diff(rough))) + 0.05
    return (even if is_even else rough), samples

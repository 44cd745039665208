"""Videos with a GoPro's telemetry of satellites and inertial sensors in a track beside the picture."""

import struct
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

_EVERY_S = 0.5


def record(name: bytes, kind: bytes, size: int, content: bytes) -> bytes:
    """A GPMF record: elements of ``size`` bytes, filled up to four."""
    return struct.pack(">4scBH", name, kind, size, len(content) // size) + content + bytes(-len(content) % 4)


def nested(name: bytes, *records: bytes) -> bytes:
    """A GPMF record that holds others."""
    return struct.pack(">4sBBH", name, 0, 1, len(b"".join(records))) + b"".join(records)


def payload(at: datetime, gps9: bool, fix: int = 3) -> bytes:
    """What a camera says of the satellites at a time."""
    if gps9:
        since = at - datetime(2000, 1, 1, tzinfo=UTC)
        reading = struct.pack(
            ">7i2H", 0, 0, 0, 0, 0, since.days, round(since.seconds * 1e3 + since.microseconds / 1e3), 1, fix
        )
        stream = [record(b"STNM", b"c", 1, b"GPS (Lat., Long.)"), record(b"GPS9", b"?", 32, reading)]
    else:
        text = (at.strftime("%y%m%d%H%M%S") + f".{at.microsecond // 1000:03d}").encode()
        stream = [record(b"GPSF", b"L", 4, struct.pack(">I", fix)), record(b"GPSU", b"U", 16, text)]
    gyroscope = nested(b"STRM", record(b"GYRO", b"s", 6, struct.pack(">6h", *range(6))))
    return nested(b"DEVC", record(b"DVID", b"L", 4, bytes(4)), gyroscope, nested(b"STRM", *stream))


def inertial_payloads(
    gyroscope: np.ndarray, accelerometer: np.ndarray, rate_hz: float, iori: tuple[float, ...] | None = None
) -> list[bytes]:
    """Payloads each half of a second, of samples (N, 3) in a HERO8's axes: X right, Y forward, Z up.

    Args:
        gyroscope: [rad/s].
        accelerometer: [m/s^2].
        rate_hz: of both.
        iori: orientation of each image against the camera, a quaternion (w, x, y, z).
    """
    length = round(rate_hz * _EVERY_S)
    payloads = []
    for first in range(0, len(gyroscope), length):
        streams = []
        for name, values, scale in ((b"GYRO", gyroscope, 939), (b"ACCL", accelerometer, 417)):
            x, y, z = values[first : first + length].T
            numbers = np.round(scale * np.stack([x, -z, y], axis=1)).astype(">i2")
            fields = [record(b"ORIN", b"c", 1, b"XzY"), record(b"SCAL", b"s", 2, struct.pack(">h", scale))]
            streams.append(nested(b"STRM", *fields, record(name, b"s", 6, numbers.tobytes())))
        if iori is not None:
            numbers = np.round(32767 * np.array(iori)).astype(">i2")
            streams.append(nested(b"STRM", record(b"IORI", b"s", 8, numbers.tobytes())))
        payloads.append(nested(b"DEVC", record(b"DVID", b"L", 4, bytes(4)), *streams))
    return payloads


def add_telemetry(
    video: Path,
    path: Path,
    began: datetime,
    gps9: bool = False,
    content: bytes | None = None,
    payloads: list[bytes] | None = None,
) -> Path:
    """Copy a video of some seconds, with a payload each half of a second; ``began`` is UTC at its media time 0.

    A track of other data lies before the telemetry, as a GoPro's time code does.
    """
    if payloads is None:
        times = [began + timedelta(seconds=number * _EVERY_S) for number in range(4)]
        payloads = [payload(time, gps9) if content is None else content for time in times]
    with av.open(str(video)) as source, av.open(str(path), "w") as container:
        picture = source.streams.video[0]
        copied = container.add_stream_from_template(picture)
        before = container.add_data_stream("bin_data")
        data = container.add_data_stream("bin_data")
        data.time_base = before.time_base = Fraction(1, 1000)
        for packet in source.demux(picture):
            if packet.pts is not None:
                packet.stream = copied
                container.mux(packet)
        time_code = av.Packet(bytes(4))
        time_code.stream, time_code.time_base, time_code.pts, time_code.dts = before, Fraction(1, 1000), 0, 0
        container.mux(time_code)
        for number, each in enumerate(payloads):
            packet = av.Packet(each)
            packet.stream, packet.time_base = data, Fraction(1, 1000)
            packet.pts = packet.dts = round(1e3 * number * _EVERY_S)
            packet.duration = round(1e3 * _EVERY_S)
            container.mux(packet)
    return path

"""Videos with a GoPro's telemetry of inertial sensors in a track beside the picture."""

import struct
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


def inertial_payloads(
    gyroscope: np.ndarray,
    accelerometer: np.ndarray,
    rate_hz: float,
    iori: tuple[float, ...] | None = None,
    matrix: np.ndarray | None = None,
) -> list[bytes]:
    """Payloads each half of a second, of samples (N, 3) in a HERO8's axes: X right, Y forward, Z up.

    Args:
        gyroscope: [rad/s].
        accelerometer: [m/s^2].
        rate_hz: of both.
        iori: orientation of each image against the camera, a quaternion (w, x, y, z).
        matrix: (3, 3) Z, X, Y of the camera by the channels, of a sensor that lies otherwise in it.
    """
    length = round(rate_hz * _EVERY_S)
    payloads = []
    for first in range(0, len(gyroscope), length):
        streams = []
        for name, values, scale in ((b"GYRO", gyroscope, 939), (b"ACCL", accelerometer, 417)):
            x, y, z = values[first : first + length].T
            channels = np.stack([x, -z, y], axis=1)
            fields = [record(b"ORIN", b"c", 1, b"XzY"), record(b"SCAL", b"s", 2, struct.pack(">h", scale))]
            if matrix is not None:
                channels = np.stack([z, x, y], axis=1) @ np.linalg.inv(matrix).T
                fields += [record(b"ORIO", b"c", 1, b"ZXY"), record(b"MTRX", b"f", 36, matrix.astype(">f4").tobytes())]
            numbers = np.round(scale * channels).astype(">i2")
            streams.append(nested(b"STRM", *fields, record(name, b"s", 6, numbers.tobytes())))
        if iori is not None:
            numbers = np.round(32767 * np.array(iori)).astype(">i2")
            streams.append(nested(b"STRM", record(b"IORI", b"s", 8, numbers.tobytes())))
        payloads.append(nested(b"DEVC", record(b"DVID", b"L", 4, bytes(4)), *streams))
    return payloads


def add_telemetry(video: Path, path: Path, payloads: list[bytes]) -> Path:
    """Copy a video of some seconds, with a payload each half of a second.

    A track of other data lies before the telemetry, as a GoPro's time code does.
    """
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
        time_code.stream = before
        time_code.time_base = Fraction(1, 1000)
        time_code.pts = 0
        time_code.dts = 0
        container.mux(time_code)
        for number, each in enumerate(payloads):
            packet = av.Packet(each)
            packet.stream, packet.time_base = data, Fraction(1, 1000)
            packet.pts = packet.dts = round(1e3 * number * _EVERY_S)
            packet.duration = round(1e3 * _EVERY_S)
            container.mux(packet)
    return path

"""Small videos as cameras make them, whose pictures carry the number of their frame."""

import struct
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

WIDTH, HEIGHT = 96, 64
RATE_HZ = 30.0
SOUND_HZ = 48_000
_TICKS_HZ = 90_000
_CELL = 12


def picture(number: int, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """Grey texture that drifts; its top row of cells holds the bits of the number."""
    noise = np.random.default_rng(5).integers(60, 200, (height // 4, width // 2), np.uint8)
    texture = cv2.resize(np.roll(noise, number, axis=1), (2 * width, height), interpolation=cv2.INTER_LINEAR)
    image = np.ascontiguousarray(texture[:, :width])
    for bit in range(width // _CELL):
        image[:_CELL, bit * _CELL : (bit + 1) * _CELL] = 235 if number >> bit & 1 else 20
    return image


def number_in(grey: np.ndarray) -> int:
    """Which frame a picture is."""
    cells = grey[_CELL // 4 : 3 * _CELL // 4].reshape(_CELL // 2, -1, _CELL).mean(axis=(0, 2))
    return sum(1 << bit for bit, brightness in enumerate(cells) if brightness > 128)


def make_video(
    path: Path,
    frames: int = 40,
    rate_hz: float = RATE_HZ,
    times_s: Sequence[float] | None = None,
    first: int = 0,
    codec: str = "libx264",
    b_frames: int = 0,
    keyframe_every: int = 10,
    full_range: bool = False,
    sound: Callable[[np.ndarray], np.ndarray] | None = None,
    created: str | None = None,
    fast_start: bool = False,
    preset: str = "veryfast",
    size: tuple[int, int] = (WIDTH, HEIGHT),
    bits: int = 8,
) -> Path:
    """Write an MP4.

    Args:
        times_s: presentation times [s]; by default even at ``rate_hz``.
        first: number of the first picture.
        b_frames: in a row.
        keyframe_every: frames.
        sound: media times [s] -> samples -1 to 1, as AAC.
        created: creation_time, as in "2024-05-01T12:00:00Z".
        fast_start: put the index in front.
        bits: of a channel, 8 or 10.
    """
    times_s = [number / rate_hz for number in range(frames)] if times_s is None else times_s
    options = {"movflags": "faststart"} if fast_start else {}
    with av.open(str(path), "w", options=options) as container:
        if created:
            container.metadata["creation_time"] = created
        stream = container.add_stream(codec, rate=Fraction(rate_hz).limit_denominator(1001))
        stream.width, stream.height = size
        stream.pix_fmt = pixels = "yuv420p10le" if bits == 10 else "yuv420p"
        context = stream.codec_context
        context.time_base = Fraction(1, _TICKS_HZ)
        context.gop_size = keyframe_every
        context.color_range = 2 if full_range else 1
        if codec == "libx265":
            parameters = f"bframes={b_frames}:keyint={keyframe_every}:log-level=none:open-gop=0"
            context.options = {"x265-params": parameters, "preset": "ultrafast"}
        else:
            context.max_b_frames = b_frames
            context.options = {"crf": "12", "b_strategy": "0", "preset": preset}
        track = container.add_stream("aac", rate=SOUND_HZ, layout="mono") if sound else None
        for number, media_s in enumerate(times_s):
            frame = av.VideoFrame.from_ndarray(picture(first + number, *size), format="gray")
            frame = frame.reformat(format=pixels, dst_color_range=2 if full_range else 1)
            frame.pts, frame.time_base = round(media_s * _TICKS_HZ), Fraction(1, _TICKS_HZ)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        if track is not None and sound is not None:
            length = round((times_s[-1] + 1.0 / rate_hz) * SOUND_HZ)
            samples = sound(np.arange(length) / SOUND_HZ).astype(np.float32)
            for start in range(0, length, 1024):
                block = av.AudioFrame.from_ndarray(samples[None, start : start + 1024], format="fltp", layout="mono")
                block.sample_rate = SOUND_HZ
                block.pts = start
                block.time_base = Fraction(1, SOUND_HZ)
                container.mux(track.encode(block))
            container.mux(track.encode(None))
    return path


def turn(path: Path, degrees: int) -> Path:
    """Write into the video's track header that its frames are to be turned clockwise, as a camera held askew does."""
    cosine, sine = {0: (1, 0), 90: (0, 1), 180: (-1, 0), 270: (0, -1)}[degrees]
    content = bytearray(path.read_bytes())
    at = content.index(b"tkhd") + 4  # the first track is the video
    version = content[at]
    at += 40 if version == 0 else 52
    one = 1 << 16
    matrix = (cosine * one, sine * one, 0, -sine * one, cosine * one, 0, 0, 0, 1 << 30)
    content[at : at + 36] = struct.pack(">9i", *matrix)
    path.write_bytes(content)
    return path


def write_lens(path: Path, size: tuple[int, int] = (WIDTH, HEIGHT), more: str = "") -> Path:
    """Write a camera_info YAML of an equidistant lens."""
    width, height = size
    path.write_text(
        f"image_width: {width}\nimage_height: {height}\ncamera_name: any\ndistortion_model: equidistant\n"
        f"camera_matrix: {{rows: 3, cols: 3, data: [40.0, 0, {width / 2}, 0, 40.0, {height / 2}, 0, 0, 1]}}\n"
        f"distortion_coefficients: {{rows: 1, cols: 4, data: [0, 0, 0, 0]}}\n{more}"
    )
    return path

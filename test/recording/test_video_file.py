import socket
from pathlib import Path

import numpy as np
import pytest
from av import VideoFrame
from helpers.made_video import HEIGHT, RATE_HZ, WIDTH, make_video, number_in, picture, turn
from helpers.naming import naming

from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.video_decoder import VideoDecoder
from bodycam_ros.recording.video_encoder import h264_packets
from bodycam_ros.recording.video_file import DecodedFrame, TimedPacket, frames, packets, read_facts


def decoded(source: list[TimedPacket]) -> list[tuple[float, np.ndarray]]:
    """Media time and picture of packets, as whoever reads a bag decodes them."""
    decoder = VideoDecoder()
    images = [CameraImage("cam", round(1e9 * media_s), packet) for media_s, packet in source]
    ready = [image for given in images for image in decoder.feed(given)] + decoder.flush()
    return [(1e-9 * image.stamp_ns, decode_grey(image)) for image in ready]


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
def test_packets_decode_to_the_frames_of_the_file(tmp_path: Path, codec: str) -> None:
    path = make_video(tmp_path / "head.mp4", codec=codec)
    facts = read_facts(path)
    assert facts.codec == {"libx264": "h264", "libx265": "hevc"}[codec]
    assert (facts.width, facts.height, facts.frames, facts.is_upright_annex_b) == (WIDTH, HEIGHT, 40, True)
    of_packets, of_file = decoded(list(packets(path))), list(frames(path))
    assert len(of_packets) == len(of_file) == 40
    for number, ((packet_s, grey), (frame_s, frame)) in enumerate(zip(of_packets, of_file, strict=True)):
        assert packet_s == pytest.approx(number / RATE_HZ, abs=1e-6) == frame_s
        np.testing.assert_array_equal(grey, DecodedFrame(frame).grey())
        assert number_in(grey) == number
        assert np.abs(grey.astype(int) - picture(number)).mean() < 5.0


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
def test_b_frames_are_noticed_and_compressed_away(tmp_path: Path, codec: str) -> None:
    path = make_video(tmp_path / "head.mp4", b_frames=2, codec=codec)
    facts = read_facts(path)
    assert facts.has_b_frames and not facts.is_upright_annex_b
    anew = list(h264_packets(frames(path), 0, facts.rate_hz, 1))
    times = [media_s for media_s, _ in anew]
    np.testing.assert_allclose(times, np.arange(40) / RATE_HZ, atol=2e-5)
    assert anew[0][1].is_key and not anew[1][1].is_key and anew[30][1].is_key
    for (_, grey), (_, frame) in zip(decoded(anew), frames(path), strict=True):
        assert np.abs(grey.astype(int) - DecodedFrame(frame).grey()).mean() < 1.5
    assert [number_in(grey) for _, grey in decoded(anew)] == list(range(40))


def test_light_with_head_and_foot_room_is_stretched() -> None:
    luma = np.arange(256, dtype=np.uint8).reshape(16, 16)
    frame = VideoFrame.from_ndarray(np.vstack([luma, np.full((8, 16), 128, np.uint8)]), format="yuv420p")
    expected = np.clip(np.round((luma.astype(np.float64) - 16.0) * 255.0 / 219.0), 0.0, 255.0)
    np.testing.assert_array_equal(DecodedFrame(frame).grey(), expected)


@pytest.mark.parametrize("clockwise", [90, 180, 270])
def test_what_lies_on_its_side_is_turned(tmp_path: Path, clockwise: int) -> None:
    path = turn(make_video(tmp_path / "head.mp4", frames=6), clockwise)
    facts = read_facts(path)
    upright = (WIDTH, HEIGHT) if clockwise == 180 else (HEIGHT, WIDTH)
    assert ((facts.width, facts.height), facts.is_upright_annex_b) == (upright, False)
    anew = decoded(list(h264_packets(frames(path), facts.rotation_deg, facts.rate_hz, 1)))
    assert len(anew) == 6
    for number, (_, grey) in enumerate(anew):
        expected = np.rot90(picture(number), -clockwise // 90).astype(int)
        assert np.abs(grey - expected).mean() < 4.0


def test_a_file_that_breaks_off_gives_what_is_there(tmp_path: Path) -> None:
    path = make_video(tmp_path / "head.mp4", frames=60, fast_start=True, sound=lambda t: np.sin(3000.0 * t))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert read_facts(path).frames == 60
    of_packets = decoded(list(packets(path)))
    assert 10 < len(of_packets) < 60
    assert [number_in(grey) for _, grey in of_packets] == list(range(len(of_packets)))
    assert len(of_packets) - 2 <= len(list(frames(path))) <= len(of_packets)
    assert list(CameraVideo.of_files("head", [path]).sound())


@pytest.mark.parametrize("content", [b"", b"\xff\xd8\xff\xe0" + bytes(500), None], ids=["empty", "picture", "missing"])
def test_what_is_no_video_is_named(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "head.mp4"
    if content is not None:
        path.write_bytes(content)
    with naming(RecordingError, tmp_path / "head.mp4"):
        read_facts(path)


def test_damaged_bytes_never_raise_anything_else(tmp_path: Path) -> None:
    whole = make_video(tmp_path / "whole.mp4", fast_start=True, sound=lambda t: np.sin(3000.0 * t)).read_bytes()
    random = np.random.default_rng(3)
    readable = 0
    for _ in range(60):
        damaged = bytearray(whole)
        for place in random.integers(0, len(damaged), random.integers(1, 40)):
            damaged[place] = int(random.integers(256))
        path = tmp_path / "damaged.mp4"
        path.write_bytes(damaged)
        try:
            video = CameraVideo.of_files("head", [path])
            frames_read = len(list(video.packets())) if video.facts.is_upright_annex_b else 0
            list(video.frames(1)), list(video.sound())
            readable += frames_read > 0
        except RecordingError as error:
            assert "damaged.mp4" in str(error)
    assert readable > 10


def test_chapters_are_one_recording(tmp_path: Path) -> None:
    tone = 440.0 * 2.0 * np.pi
    one = make_video(tmp_path / "GH010001.MP4", frames=30, sound=lambda t: 0.5 * np.sin(tone * t))
    two = make_video(tmp_path / "GH020001.MP4", frames=30, first=30, sound=lambda t: 0.5 * np.sin(tone * (t + 1.0)))
    video = CameraVideo.of_files("GH010001", [one, two])
    assert video.facts.duration_s == pytest.approx(2.0, abs=1e-3)
    pictures = [number_in(grey) for _, grey in decoded(list(video.packets()))]
    assert pictures == list(range(60))
    np.testing.assert_allclose([media_s for media_s, _ in video.packets()], np.arange(60) / RATE_HZ, atol=1e-3)
    other = make_video(tmp_path / "GH030001.MP4", frames=3, size=(64, 64))
    with naming(RecordingError, other):
        CameraVideo.of_files("GH010001", [one, other])


def test_files_of_other_rates_are_not_chapters_of_one_recording(tmp_path: Path) -> None:
    walk = make_video(tmp_path / "head.mp4", frames=60, rate_hz=30.0)
    rom = make_video(tmp_path / "head_2.mp4", frames=60, rate_hz=24.0, first=60)
    with naming(RecordingError, rom, "24", "30"):
        CameraVideo.of_files("head", [walk, rom])
    end = make_video(tmp_path / "head_3.mp4", frames=2, rate_hz=15.0)  # the rate of a last few frames is chance
    assert len(CameraVideo.of_files("head", [walk, end]).chapters) == 2


def test_chapters_by_their_names_alone_are_known_as_such(tmp_path: Path) -> None:
    def is_by_name(*names: str, created: str | None = None) -> bool:
        files = [make_video(tmp_path / n, frames=9 + k, created=created) for k, n in enumerate(names)]
        return CameraVideo.of_files("head", files).is_joined_by_name

    assert is_by_name("head.mp4", "head_2.mp4")
    assert not is_by_name("a_1.mp4", "a_2.mp4", created="2024-05-01T12:00:00Z")
    assert not is_by_name("GH010001.MP4", "GH020001.MP4") and not is_by_name("alone.mp4")


@pytest.mark.parametrize(
    "content",
    [
        "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\n{address}\n#EXT-X-ENDLIST\n",
        "ffconcat version 1.0\nfile '{address}'\n",
        "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 5004 RTP/AVP 96\n",
    ],
)
def test_a_list_of_other_files_or_addresses_is_no_video(content: str, tmp_path: Path) -> None:
    make_video(tmp_path / "other.mp4", frames=5)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.0)
        address = f"http://127.0.0.1:{server.getsockname()[1]}/a.ts"
        (tmp_path / "head.mp4").write_text(content.format(address=address))
        with naming(RecordingError, tmp_path / "head.mp4"):
            read_facts(tmp_path / "head.mp4")
        with pytest.raises(BlockingIOError):  # nobody has come
            server.accept()

"""Inertial samples of GoPro files and of CSVs, as the bag has them."""

from pathlib import Path

import numpy as np
import pytest
from helpers.made_telemetry import add_telemetry, inertial_payloads, nested, record
from helpers.made_video import make_video, write_lens
from helpers.naming import naming

from bodycam_ros.cli.main import main
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import exp_so3
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.imu_reader import read_imus
from bodycam_ros.recording.telemetry import inertial_samples, stabilisation

RATE_HZ = 200.0
TIMES_S = np.arange(600) / RATE_HZ
GYROSCOPE = np.column_stack([np.sin(3.0 * TIMES_S), 0.5 * np.cos(2.0 * TIMES_S), 0.2 * TIMES_S])
ACCELEROMETER = np.column_stack([np.sin(TIMES_S), np.cos(TIMES_S), 9.8 + 0.0 * TIMES_S])


def optical(camera: np.ndarray) -> np.ndarray:
    """X right, Y forward, Z up -> x right, y down, z forward."""
    return np.column_stack([camera[:, 0], -camera[:, 2], camera[:, 1]])


def go_pro(folder: Path, name: str = "head", **options: object) -> Path:
    plain = make_video(folder / "plain.mp4", frames=90)
    write_lens(folder / f"{name}.yaml")
    return add_telemetry(plain, folder / f"{name}.mp4", inertial_payloads(GYROSCOPE, ACCELEROMETER, RATE_HZ, **options))


def test_samples_of_a_gopro_have_the_optical_frame_s_axes(tmp_path: Path) -> None:
    samples = inertial_samples(go_pro(tmp_path))
    assert samples is not None
    np.testing.assert_allclose(1e-9 * samples.stamps_ns, TIMES_S, atol=3e-3)
    np.testing.assert_allclose(1e-9 * np.diff(samples.stamps_ns), 1.0 / RATE_HZ, rtol=1e-3)
    np.testing.assert_allclose(samples.angular_velocity, optical(GYROSCOPE), atol=1e-3)
    np.testing.assert_allclose(samples.acceleration, optical(ACCELEROMETER), atol=5e-3)


def test_a_last_payload_that_is_not_full_is_as_quick_as_the_others(tmp_path: Path) -> None:
    """The container gives it the length of the others; a HERO5's last 28 samples came out over a second."""
    plain = make_video(tmp_path / "plain.mp4", frames=90)
    payloads = inertial_payloads(GYROSCOPE[:520], ACCELEROMETER[:520], RATE_HZ)
    samples = inertial_samples(add_telemetry(plain, tmp_path / "head.mp4", payloads))
    assert samples is not None
    np.testing.assert_allclose(1e-9 * samples.stamps_ns, TIMES_S[:520], atol=3e-3)
    np.testing.assert_allclose(1e-9 * np.diff(samples.stamps_ns), 1.0 / RATE_HZ, rtol=1e-3)


@pytest.mark.parametrize("turned_rad", [0.0, 0.1])
def test_the_axes_of_a_matrix_come_before_those_of_the_channels(tmp_path: Path, turned_rad: float) -> None:
    """A sensor that lies in the camera turned by some degrees. A matrix that only exchanges axes is left to ORIN."""
    turn = exp_so3(turned_rad * np.array([1.0, -2.0, 0.5]))
    letters = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # of XzY to ZXY
    samples = inertial_samples(go_pro(tmp_path, matrix=turn @ letters))
    assert samples is not None
    np.testing.assert_allclose(samples.angular_velocity, optical(GYROSCOPE), atol=2e-3)
    np.testing.assert_allclose(samples.acceleration, optical(ACCELEROMETER), atol=5e-3)


def test_the_bag_has_them_as_messages_at_the_time_of_the_frames(tmp_path: Path) -> None:
    video = go_pro(tmp_path)
    assert main(["ingest", str(video), "-o", str(tmp_path / "bag")]) == 0
    samples = read_imus([tmp_path / "bag"], ["head"])["head"]
    np.testing.assert_allclose(samples.angular_velocity, optical(GYROSCOPE), atol=1e-3)
    with BagFile(tmp_path / "bag") as bag:
        first = next(m for _, _, m in bag.messages(["/head/imu"]))
        frame = next(m for _, _, m in bag.messages(["/head/image_raw/compressed_video"]))
    assert first.header.frame_id == "head_imu_frame" and first.orientation_covariance[0] == -1.0
    frame_ns = frame.timestamp.sec * 10**9 + frame.timestamp.nanosec
    assert abs(int(samples.stamps_ns[0]) - frame_ns) < 5e6


def test_a_csv_beside_a_file_comes_first(tmp_path: Path) -> None:
    video = go_pro(tmp_path)
    rows = np.column_stack([TIMES_S + 0.001, GYROSCOPE[::-1], ACCELEROMETER])
    np.savetxt(tmp_path / "head.csv", rows, header="time,gx,gy,gz,ax,ay,az", comments="", delimiter=",")
    assert main(["ingest", str(video), "-o", str(tmp_path / "bag")]) == 0
    np.testing.assert_allclose(
        read_imus([tmp_path / "bag"], ["head"])["head"].angular_velocity, GYROSCOPE[::-1], atol=1e-9
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time gx gy gz ax ay az\n0 0 0 200 0 0 9.8\n1 0 0 0 0 0 9.8\n", "look like deg/s"),
        ("0 0 0 0 0 0 1\n1 0 0 0 0 0 1\n", "expected m/s^2"),
        ("t,wx,wy,wz,ax,ay,az\n0,0,0,0,0,0,9.8\n", "expected the columns time gx"),
        ("0 0 0 0 0 9.8\n", "seven numbers"),
        ("1 0 0 0 0 0 9.8\n0 0 0 0 0 0 9.8\n", "do not increase"),
    ],
)
def test_a_csv_that_cannot_be_used_is_named_and_the_frames_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    video = go_pro(tmp_path)
    (tmp_path / "head.csv").write_text(text)
    assert main(["ingest", str(video), "-o", str(tmp_path / "bag")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "camera head: its inertial sensor is not used:" in said and message in said
    assert read_imus([tmp_path / "bag"], ["head"]) == {}


def test_time_lapse_samples_are_refused(tmp_path: Path) -> None:
    sparse = inertial_payloads(GYROSCOPE[:180], ACCELEROMETER[:180], 30.0)
    video = add_telemetry(make_video(tmp_path / "plain.mp4", frames=90), tmp_path / "lapse.mp4", sparse)
    with naming(RecordingError, video, "gyroscope", "30 samples"):
        inertial_samples(video)


def test_stabilised_images_are_refused_with_the_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert stabilisation(go_pro(tmp_path, iori=(1.0, 0.0, 0.0, 0.0))) == ""
    turned = go_pro(tmp_path, name="shin", iori=(np.cos(0.02), np.sin(0.02), 0.0, 0.0))
    assert "turned by 2.3 deg" in stabilisation(turned)
    assert main(["ingest", str(turned), "-o", str(tmp_path / "bag")]) == 1
    assert "electronic stabilisation" in " ".join(capsys.readouterr().err.split())


def test_the_setting_of_stabilisation_is_read(tmp_path: Path) -> None:
    video = make_video(tmp_path / "head.mp4", frames=3)
    telemetry = nested(b"DEVC", record(b"EISE", b"c", 1, b"Y"))
    user_data = box(b"udta", box(b"GPMF", telemetry))
    content = bytearray(video.read_bytes())
    at = content.index(b"moov") - 4
    size = int.from_bytes(content[at : at + 4], "big")
    content[at : at + 4] = (size + len(user_data)).to_bytes(4, "big")
    content[at + size : at + size] = user_data
    video.write_bytes(content)
    assert stabilisation(video) == "its setting EISE is on"


def box(name: bytes, content: bytes) -> bytes:
    return (8 + len(content)).to_bytes(4, "big") + name + content


def test_telemetry_that_makes_no_sense_is_passed_over(tmp_path: Path) -> None:
    (whole, *_) = inertial_payloads(GYROSCOPE, ACCELEROMETER, RATE_HZ)
    plain = make_video(tmp_path / "plain.mp4", frames=3)
    for number, content in enumerate([whole[:30], whole[:8] + b"\xff" * 60, b"DEVC\x00\x01\xff\xff" * 20, bytes(64)]):
        path = add_telemetry(plain, tmp_path / f"odd_{number}.mp4", [content] * 4)
        assert inertial_samples(path) is None and stabilisation(path) == ""

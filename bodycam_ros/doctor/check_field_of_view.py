"""Whether cameras that hardly find themselves have the lens that they recorded with."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from bodycam_ros.doctor.doctor_settings import DoctorSettings
from bodycam_ros.doctor.finding import Finding, Light
from bodycam_ros.doctor.registered_samples import RegisteredSamples
from bodycam_ros.lens.recorded_lens import other_lenses
from bodycam_ros.mapping.progress import Progress

_CHECK = "lens"


def check_field_of_view(
    recording: Path, registered: RegisteredSamples, settings: DoctorSettings, progress: Progress
) -> Iterator[Finding]:
    """Compare lenses with what their cameras saw: some seconds a camera, so only of those that give cause to."""
    doubted: Sequence[str] = sorted(c for c in registered.poses if registered.share(c) < settings.registered)
    if not doubted:
        return
    with progress.step("lenses", len(doubted)) as advance:
        for camera in doubted:
            for match in other_lenses(recording, [camera]):
                said = match.text.removeprefix(f"camera {camera}: ")
                yield Finding(_CHECK, Light.RED, said, of=f"camera {camera}")
            advance()

"""Cameras of a replay whose lenses may not be those that the recording was made with."""

from bodycam_ros.offline.replay_summary import ReplaySummary

_WELL_REGISTERED = 0.6
"""Share of its images that a camera with the right lens is registered on, unless it is covered."""


def doubted_cameras(summary: ReplaySummary) -> tuple[str, ...]:
    """Cameras that were registered so seldom, or contradict so much, that their lens may be another's."""
    accused = {finding.camera for finding in summary.verdict.findings if finding.part == "camera"}
    return tuple(
        camera
        for camera, images in sorted(summary.images.items())
        if camera in accused or summary.registered[camera] < _WELL_REGISTERED * images
    )

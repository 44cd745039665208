"""Settings of how a body is coupled to its equipment."""

from dataclasses import dataclass

from bodycam_ros.errors import SettingsError
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class CouplingSettings:
    """When attachments hold, and how what is unknown of the equipment is learned."""

    release_distance: float = setting(
        0.05,
        unit="m",
        limits=(0.001, 1.0),
        reason="an attachment whose points are seen farther apart than this has been let go: more than a body errs by",
    )
    engage_distance: float = setting(
        0.03,
        unit="m",
        limits=(0.001, 1.0),
        reason="one that was let go holds again when its points are nearer than this",
    )
    confirm_frames: int = setting(
        3,
        unit="frames",
        limits=(1, 100),
        reason="so many instants in a row must say so; a wrong registration is shorter",
    )
    kernel: float = setting(
        4.0,
        limits=(1.0, 100.0),
        reason="sigmas beyond which an attachment pulls less and less (Cauchy): one that is let go must not bend a leg",
    )
    learn_every: float = setting(
        0.5,
        unit="s",
        limits=(0.05, 60.0),
        reason="of seen motion, before what is unknown of the equipment is fitted anew",
    )
    learn_rate: float = setting(
        10.0, unit="Hz", limits=(0.5, 120.0), reason="instants that the fit keeps; neighbours say nothing new"
    )
    learn_instants: int = setting(
        200,
        limits=(10, 5000),
        reason="so many at most, spread over all that was seen: the time of a fit grows with them",
    )
    speed_time: float = setting(
        0.06,
        unit="s",
        limits=(0.01, 10.0),
        reason="a segment that keeps its speed keeps the mean over so long; two images alone say little of a speed",
    )

    def __post_init__(self) -> None:
        """Refuse what would flip between two states.

        Raises:
            SettingsError: an attachment would be held again farther off than it is let go.
        """
        if self.engage_distance > self.release_distance:
            raise SettingsError(
                f"coupling.engage_distance = {self.engage_distance:g} m is more than coupling.release_distance = "
                f"{self.release_distance:g} m; what was let go must come nearer than that to hold again"
            )

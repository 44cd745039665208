"""Settings of how a body is coupled to its equipment."""

from dataclasses import dataclass

from bodycam_ros.errors import SettingsError
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class CouplingSettings:
    """When attachments hold."""

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

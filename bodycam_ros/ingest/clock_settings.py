"""Settings of how the clocks of cameras are found."""

from dataclasses import dataclass

from bodycam_ros.settings import SettingsGroups, setting


@dataclass(frozen=True)
class ClockSettings:
    """Whose time is the recording's, and where claps come from."""

    reference: str = setting("", reason="camera whose time is the recording's; empty: the one that shares most sounds")
    wearer_claps: bool = setting(
        False, reason="the wearer's own hands clap, not a board beside: nominal distances to the segments are taken off"
    )


@dataclass(frozen=True)
class IngestSettings(SettingsGroups):
    """Settings of ``bodycam ingest``."""

    clocks: ClockSettings = ClockSettings()

"""All settings that clocks are found by from sound, by group."""

from dataclasses import dataclass

from bodycam_ros.ingest.clap_places import ClapSettings
from bodycam_ros.ingest.clock_fit import ClockSettings
from bodycam_ros.ingest.sound_peaks import PeakSettings
from bodycam_ros.ingest.whole_sound import WholeSoundSettings
from bodycam_ros.settings import SettingsGroups


@dataclass(frozen=True)
class SoundSettings(SettingsGroups):
    """Settings of every step from sound to clocks."""

    sound_peaks: PeakSettings = PeakSettings()
    claps: ClapSettings = ClapSettings()
    whole_sound: WholeSoundSettings = WholeSoundSettings()
    clocks: ClockSettings = ClockSettings()

"""The parameters that every node has."""

from dataclasses import dataclass

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class CommonParameters:
    """Of every node."""

    moments: str = setting(
        "", reason="CSV file to be, of when each frame came and went; 'bodycam latency' tells from it what takes long"
    )

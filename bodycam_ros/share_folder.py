"""Where launch files and configurations are, be the package installed by pip or colcon, or run from its sources."""

from pathlib import Path

from bodycam_ros.errors import BodycamError

_A_FILE = "config/all_settings.yaml"


def share_folder() -> Path:
    """The folder that has ``config/`` and ``launch/``.

    pip and colcon both put it beneath the prefix that holds the package: a virtual environment, a workspace, the
    user's own or the system's.

    Raises:
        BodycamError: it is nowhere; the installation is not whole.
    """
    package = Path(__file__).resolve().parent
    for prefix in package.parents:
        for folder in (prefix / "share" / package.name, prefix):
            if (folder / _A_FILE).is_file():
                return folder
    raise BodycamError(f"{package}: there is no share/{package.name}/{_A_FILE} above it; install the package anew")

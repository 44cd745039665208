"""How a cluster is asked: a Snakemake profile, ours for Slurm or one of the user's."""

from pathlib import Path

from bodycam_ros.errors import StudyError
from bodycam_ros.whole_file import write_whole

SLURM = "slurm"
_FILE = "config.yaml"
_PROFILE = """\
# How 'bodycam study --profile slurm' asks the cluster; written once, change it as you like.
# https://snakemake.github.io/snakemake-plugin-catalog/plugins/executor/slurm.html explains what else there is.
executor: slurm
jobs: 100               # in the queue at a time
latency-wait: 60        # seconds until a file that a job wrote must be seen on this machine
# default-resources:    # what the cluster wants to know of every job
#   slurm_account: ACCOUNT
#   slurm_partition: PARTITION
#   runtime: 120        # minutes
"""


def profile_folder(name: str, folder: Path) -> Path:
    """The folder of a profile; that for Slurm is made in the folder of the study, if it is not there.

    Args:
        name: ``slurm``, or the path of a profile.
        folder: of the study.

    Raises:
        StudyError: there is no such profile.
    """
    if name == SLURM:
        profile = folder / "profiles" / SLURM
        if not (profile / _FILE).exists():
            profile.mkdir(parents=True, exist_ok=True)
            write_whole(profile / _FILE, _PROFILE)
        return profile
    given = Path(name).absolute()
    if not any(given.glob("config*.yaml")):
        raise StudyError(f"--profile {name}: is neither {SLURM} nor a folder with a Snakemake profile ({_FILE})")
    return given

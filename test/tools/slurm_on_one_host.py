"""Run a command with a Slurm of this machine alone: python test/tools/slurm_on_one_host.py COMMAND...

Debian's daemons (apt-get install slurmctld slurmd munge slurm-client) are started for as long as the command takes, as
root, with all their files in a temporary folder. Jobs find them by a link at Debian's place, which is there as long:
Snakemake's plugin keeps SLURM_CONF from them. So a study can be tried as on a cluster, with a profile that says
"slurm-status-command: squeue", because nobody keeps accounts here:

    slurm_on_one_host.py bodycam study STUDY.yaml --profile PROFILE_DIR
"""

import os
import platform
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

_PATIENCE_S = 60.0
_DEBIANS_PLACE = Path("/etc/slurm/slurm.conf")

_CONFIG = """\
ClusterName=one
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmdPort={daemon}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CryptoType=crypto/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=sched_interval=2
MinJobAge=3600
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory_mb} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


@contextmanager
def slurm() -> Iterator[Mapping[str, str]]:
    """Daemons while the block lasts, and the environment in which they are found."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slurm-")))
        for name in ("state", "spool"):
            (folder / name).mkdir()
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        munge = ["munged", "--foreground", "--force", f"--key-file={key}", f"--socket={folder}/munge.socket"]
        munge += [f"--{name}={folder}/munge.{name}" for name in ("pid-file", "log-file", "seed-file")]
        memory_mb = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 1_100_000
        (folder / "slurm.conf").write_text(
            _CONFIG.format(
                host=platform.node(), controller=_free_port(), daemon=_free_port(), folder=folder,
                cores=os.cpu_count(), memory_mb=memory_mb,
            )
        )  # fmt: skip
        # The older plugin asks for nothing before it is used, and it is not.
        (folder / "cgroup.conf").write_text("CgroupPlugin=cgroup/v1\n")
        if _DEBIANS_PLACE.exists() or _DEBIANS_PLACE.is_symlink():
            sys.exit(f"{_DEBIANS_PLACE}: is there; this machine has a Slurm of its own")
        _DEBIANS_PLACE.symlink_to(folder / "slurm.conf")
        stack.callback(_DEBIANS_PLACE.unlink)
        environment = {**os.environ, "SLURM_CONF": str(folder / "slurm.conf")}
        stack.enter_context(_daemon(munge, environment))
        _wait(lambda: (folder / "munge.socket").exists(), folder)
        stack.enter_context(_daemon(["slurmctld", "-D"], environment))
        stack.enter_context(_daemon(["slurmd", "-D", "-N", platform.node()], environment))
        _wait(lambda: "idle" in _said(["sinfo", "-h", "-o", "%T"], environment), folder)
        yield environment


@contextmanager
def _daemon(words: Sequence[str], environment: Mapping[str, str]) -> Iterator[None]:
    program = shutil.which(words[0], path=f"{os.environ['PATH']}:/usr/sbin") or words[0]
    with subprocess.Popen(
        [program, *words[1:]], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            yield
        finally:
            process.terminate()
            try:
                process.wait(_PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _said(words: Sequence[str], environment: Mapping[str, str]) -> str:
    return subprocess.run(words, env=environment, capture_output=True, text=True, check=False).stdout


def _wait(is_ready: Callable[[], bool], folder: Path) -> None:
    deadline = time.monotonic() + _PATIENCE_S
    while not is_ready():
        if time.monotonic() > deadline:
            logs = "\n".join(f"{log.name}:\n{log.read_text()[-2000:]}" for log in sorted(folder.glob("*.log")))
            sys.exit(f"Slurm did not come up\n{logs}")
        time.sleep(0.2)


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def main() -> None:
    """Run the command."""
    if not sys.argv[1:]:
        sys.exit(__doc__)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # no daemon outlives it
    with slurm() as environment:
        code = subprocess.run(sys.argv[1:], env=environment, check=False).returncode
    sys.exit(code)


if __name__ == "__main__":
    main()

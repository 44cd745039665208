"""A Slurm cluster of one controller and one node on this machine, with all its files in one folder."""

import getpass
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from helpers.owned_processes import ended_with_us

_PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scontrol", "scancel")

_CONFIGURATION = """\
ClusterName=bodycam_test
SlurmctldHost={host}
SlurmUser={user}
SlurmdUser={user}
AuthInfo=socket={folder}/munge.socket
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
# Control groups are not everywhere at hand: memory is sampled each second, and a job above its limit killed.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams=OverMemoryKill,UsePss
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=batch_sched_delay=1,sched_interval=2
ReturnToService=2
MinJobAge=600
KillWait=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory=4000 State=UNKNOWN
PartitionName=main Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""

_PROFILE = """\
executor: slurm
jobs: 10
retries: 2
latency-wait: 10
seconds-between-status-checks: 2
slurm-init-seconds-before-status-checks: 2
slurm-status-command: squeue
slurm-no-account: true
"""


def lacking() -> list[str]:
    """Programs that this machine lacks for a cluster."""
    return [name for name in _PROGRAMS if _program(name) is None]


class SmallCluster:
    """A cluster that runs.

    Attributes:
        host: name of its node.
        environment: for all that talks to it.
        profile: folder of a Snakemake profile that asks it often, as its jobs are short.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._servers: dict[str, subprocess.Popen[bytes]] = {}
        self.host = socket.gethostname().split(".")[0]
        self.profile = folder / "profile"
        self.profile.mkdir()
        (self.profile / "config.yaml").write_text(_PROFILE)
        configuration = folder / "slurm.conf"
        ports = [_free_port(), _free_port()]
        configuration.write_text(
            _CONFIGURATION.format(
                host=self.host, user=getpass.getuser(), folder=folder, ports=ports, cpus=os.cpu_count()
            )
        )
        for name in ("state", "spool", "bin"):
            (folder / name).mkdir()
        (folder / "munge.key").write_bytes(os.urandom(1024))
        (folder / "munge.key").chmod(0o600)
        # Snakemake takes SLURM_CONF from the environment of its jobs; a real cluster has /etc/slurm/slurm.conf.
        wrapper = folder / "bin" / "srun"
        wrapper.write_text(f'#!/bin/sh\nSLURM_CONF={configuration} exec {_program("srun")} "$@"\n')
        wrapper.chmod(0o755)
        path = f"{folder / 'bin'}:{os.environ['PATH']}:/usr/sbin"
        self.environment = {**os.environ, "SLURM_CONF": str(configuration), "PATH": path}

    def start(self, name: str, *arguments: str) -> None:
        """Start a server, which ends with the test."""
        with (self._folder / f"{name}.out").open("ab") as log:
            self._servers[name] = subprocess.Popen(
                ended_with_us([str(_program(name)), *arguments]), env=self.environment, stdout=log, stderr=log
            )

    def stop(self, name: str) -> None:
        """Stop a server."""
        server = self._servers.pop(name)
        server.terminate()
        try:
            server.wait(20)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()

    def start_controller(self) -> None:
        """Start the controller; its state is that of the last one."""
        self.start("slurmctld", "-D")

    def start_all(self) -> None:
        """Start all servers, and wait until the node takes jobs."""
        of = {name: f"--{name}-file={self._folder}/munge.{name}" for name in ("key", "pid", "log", "seed")}
        self.start("munged", "-F", "--force", f"--socket={self._folder}/munge.socket", *of.values())
        wait_until(lambda: (self._folder / "munge.socket").exists(), 10.0, "munged did not start")
        self.start_controller()
        self.start("slurmd", "-D", "-N", self.host)
        wait_until(lambda: "idle" in self.ask("sinfo", "-h", "-o", "%T"), 30.0, "the node is not idle")

    def ask(self, *command: str) -> str:
        """What a command of Slurm prints; nothing if it fails."""
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, check=False)
        return done.stdout if done.returncode == 0 else ""

    def states(self) -> list[str]:
        """States of all jobs, those that have ended included, in order of their numbers."""
        lines = self.ask("squeue", "--states=all", "--noheader", "--format=%i|%T").split()
        return [line.split("|")[1] for line in sorted(lines, key=lambda line: int(line.split("|")[0]))]


@contextmanager
def small_cluster(folder: Path) -> Iterator[SmallCluster]:
    """A cluster that runs as long as the context lasts."""
    cluster = SmallCluster(folder)
    try:
        cluster.start_all()
        yield cluster
    finally:
        with suppress(OSError):
            cluster.ask("scancel", "--user", getpass.getuser())
        for name in reversed(list(cluster._servers)):
            cluster.stop(name)


def wait_until(is_so: Callable[[], bool], timeout_s: float, otherwise: str) -> None:
    """Wait until something is so; fail with a text after a time."""
    deadline = time.monotonic() + timeout_s
    while not is_so():
        assert time.monotonic() < deadline, otherwise
        time.sleep(0.2)


def _program(name: str) -> str | None:
    return shutil.which(name) or shutil.which(name, path="/usr/sbin:/sbin")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])

"""What each job gets of a machine, so that its cores are busy and its memory is enough."""

import os
from collections.abc import Mapping
from dataclasses import dataclass

from bodycam_ros.study.study import STAGES, StageResources

_PARALLEL = ("map", "ingest", "body", "replay")
_USUAL_THREADS = 4
"""On a cluster: with more of them a single replay is quicker, with fewer a place in the queue is found sooner."""

_USUAL_MEMORY_MB = {"map": 4000, "ingest": 2000, "body": 2000, "replay": 2000, "evaluate": 2000, "export": 1000}
"""Room for longer recordings: two seconds of 16 cameras take 550 MB to replay and 210 to evaluate, a map of 12
photographs takes 740, a body of four cameras 600, an export 170."""

_MB = 1_000_000


@dataclass(frozen=True)
class JobResources:
    """What a job of each stage gets.

    Attributes:
        threads: stage -> processes or threads.
        memory_mb: stage -> memory [MB].
        limit_mb: memory of all jobs together [MB]; None: the cluster sees to it.
    """

    threads: Mapping[str, int]
    memory_mb: Mapping[str, int]
    limit_mb: int | None

    @classmethod
    def on_this_machine(cls, cores: int, jobs: Mapping[str, int], said: Mapping[str, StageResources]) -> "JobResources":
        """Share the cores among the jobs of a stage: processes of one job wait for each other, jobs do not.

        Args:
            cores: to be used.
            jobs: stage -> how many there are.
            said: by the study file, stronger than what is usual.
        """
        limit_mb = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // _MB
        threads = {stage: max(1, cores // max(1, jobs[stage])) if stage in _PARALLEL else 1 for stage in STAGES}
        usual = cls(threads, {stage: min(mb, limit_mb) for stage, mb in _USUAL_MEMORY_MB.items()}, limit_mb)
        return usual._with(said)

    @classmethod
    def on_a_cluster(cls, said: Mapping[str, StageResources]) -> "JobResources":
        """What is asked of a cluster.

        Args:
            said: by the study file, stronger than what is usual.
        """
        threads = {stage: _USUAL_THREADS if stage in _PARALLEL else 1 for stage in STAGES}
        return cls(threads, _USUAL_MEMORY_MB, None)._with(said)

    def _with(self, said: Mapping[str, StageResources]) -> "JobResources":
        threads = {stage: each.threads for stage, each in said.items() if each.threads is not None}
        memory_mb = {stage: each.memory_mb for stage, each in said.items() if each.memory_mb is not None}
        if self.limit_mb is not None:  # what no machine could give would never start
            memory_mb = {stage: min(each, self.limit_mb) for stage, each in memory_mb.items()}
        return JobResources({**self.threads, **threads}, {**self.memory_mb, **memory_mb}, self.limit_mb)

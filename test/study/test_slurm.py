"""A study of three recordings on a real Slurm, through all that may befall it, equals that of this machine."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers.altered_sample import write_altered_sample
from helpers.small_cluster import SmallCluster, lacking, small_cluster, wait_until

import bodycam_ros
from bodycam_ros.cli.main import main

ROOT = Path(bodycam_ros.__file__).parent.parent
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(bool(lacking()), reason=f"no Slurm ({', '.join(lacking())}): apt install slurm-wlm munge"),
]


@pytest.fixture(scope="module")
def cluster() -> Iterator[SmallCluster]:
    # In a short path: that of a socket has 107 characters at most.
    with tempfile.TemporaryDirectory(prefix="slurm") as folder, small_cluster(Path(folder)) as cluster:
        with pytest.MonkeyPatch.context() as patch:
            for name, value in {**cluster.environment, "PYTHONPATH": str(ROOT)}.items():
                patch.setenv(name, value)
            cluster.environment["PYTHONPATH"] = str(ROOT)
            yield cluster


@pytest.fixture(scope="module")
def study(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    (folder / "hall").symlink_to(sample / "map")
    shutil.copy(sample / "body.yaml", folder / "anna.yaml")
    for name, frames in (("walk", 8), ("turn", 12), ("longer", 60)):
        write_altered_sample(sample, folder / "takes" / name, frames=frames)
    path = folder / "knees.yaml"
    path.write_text(
        "places: {hall: {map: hall}}\nsubjects: {anna: {body: anna.yaml}}\nrecordings: [{path: takes/*}]\n"
        "exports: [csv]\n"
    )
    return path


@pytest.fixture(scope="module")
def local(study: Path) -> dict[str, bytes]:
    """The results of this machine."""
    folder = study.parent / "local"
    assert main(["study", str(study), "-o", str(folder)]) == 0
    return results_of(folder)


def results_of(folder: Path) -> dict[str, bytes]:
    files = [*folder.glob("takes/*/out/*"), *folder.glob("exports/*/*"), *folder.glob("takes/*/report/*.png")]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def command_of(study: Path, folder: Path, cluster: SmallCluster) -> list[str]:
    words = ("study", str(study), "-o", str(folder), "--jobs", "1", "--profile", str(cluster.profile))
    return [sys.executable, "-m", "bodycam_ros.cli.main", *words]


def started(study: Path, folder: Path, cluster: SmallCluster) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        command_of(study, folder, cluster), cwd=ROOT, env=cluster.environment, stdout=subprocess.PIPE, text=True
    )


def test_what_is_killed_for_its_memory_is_tried_again_with_more(
    study: Path,
    local: dict[str, bytes],
    cluster: SmallCluster,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from bodycam_ros.study import step_needs

    monkeypatch.setattr(step_needs, "_ENGINE_MB", 0.0)
    monkeypatch.setitem(step_needs._COSTS, "replay", step_needs._Cost(0.005, 200.0, 0.0, 0.0))
    folder = tmp_path / "results"
    before = len(cluster.states())
    assert main(command_of(study, folder, cluster)[3:]) == 0
    assert "FAILED" in cluster.states()[before:]
    printed = [log.read_text() for log in (folder / ".snakemake" / "slurm_logs").rglob("*.log")]
    assert printed and all("exceeded memory limit" in text for text in printed)
    said = " ".join(capsys.readouterr().out.split())
    assert "walk: replay: FAILED: SLURM-job" in said and "walk: replay: done in" in said
    assert results_of(folder) == local
    graph = json.loads((folder / "steps" / "graph.json").read_text())
    assert {step["memory_mb"] for step in graph if "replay" in step["rule"]} == {200}


def test_a_study_outlives_a_drained_node_and_a_controller_that_starts_again(
    study: Path, local: dict[str, bytes], cluster: SmallCluster, tmp_path: Path
) -> None:
    folder, before = tmp_path / "results", len(cluster.states())
    with started(study, folder, cluster) as process:
        wait_until(lambda: "RUNNING" in cluster.states()[before:], 60.0, "no job runs")
        cluster.ask("scontrol", "update", f"nodename={cluster.host}", "state=drain", "reason=test")
        wait_until(lambda: "RUNNING" not in cluster.states()[before:], 120.0, "what runs on a drained node may end")
        cluster.stop("slurmctld")
        time.sleep(3.0)
        assert process.poll() is None
        cluster.start_controller()
        wait_until(lambda: "PENDING" in cluster.states()[before:], 60.0, "what waited is forgotten")
        cluster.ask("scontrol", "update", f"nodename={cluster.host}", "state=resume")
        out, _ = process.communicate(timeout=300)
    assert process.returncode == 0, out
    assert results_of(folder) == local


def test_an_interrupted_study_leaves_the_queue_and_goes_on_later(
    study: Path, local: dict[str, bytes], cluster: SmallCluster, tmp_path: Path
) -> None:
    folder, before = tmp_path / "results", len(cluster.states())
    with started(study, folder, cluster) as process:
        done = folder / "steps" / "walk_replay.receipt"
        wait_until(done.exists, 120.0, "nothing was done")
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=90)
    assert process.returncode == 130
    wait_until(lambda: not {"RUNNING", "PENDING"} & set(cluster.states()[before:]), 20.0, "jobs are left")
    assert "CANCELLED" in cluster.states()[before:]
    receipt = done.read_text()
    again = subprocess.run(
        command_of(study, folder, cluster), cwd=ROOT, env=cluster.environment, capture_output=True, text=True
    )
    assert again.returncode == 0, again.stdout + again.stderr
    assert "walk: replay: is done" in again.stdout and done.read_text() == receipt
    assert results_of(folder) == local
    assert not os.listdir(folder / "takes" / "walk" / "out") == []

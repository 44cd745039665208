"""What lets several workers test side by side: things made once for all, and a DDS domain each."""

import multiprocessing
import time
from pathlib import Path

import pytest
from made_once import made_once
from own_domain import own_domain

_WORKERS = 3


class _Factory:
    """Folders as pytest gives them to a worker: of its own, in the folder of the run."""

    def __init__(self, worker: Path) -> None:
        self._worker = worker

    def getbasetemp(self) -> Path:
        return self._worker

    def mktemp(self, name: str) -> Path:
        folder = self._worker / f"{name}{len(list(self._worker.iterdir()))}"
        folder.mkdir()
        return folder


def _work(run: Path, number: int) -> None:
    def make(folder: Path) -> None:
        time.sleep(0.2)
        with (run / "made").open("a") as made:
            made.write(f"{number}\n")
        (folder / "result").write_text("whole")

    (run / f"worker{number}").mkdir()
    folder = made_once(_Factory(run / f"worker{number}"), "thing", make)  # type: ignore[arg-type]
    (run / f"seen{number}").write_text(f"{folder} {(folder / 'result').read_text()}")


def test_one_of_several_workers_makes_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTEST_XDIST_WORKER", "gw0")
    context = multiprocessing.get_context("fork")
    workers = [context.Process(target=_work, args=(tmp_path, number)) for number in range(_WORKERS)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len((tmp_path / "made").read_text().splitlines()) == 1
    seen = {(tmp_path / f"seen{number}").read_text() for number in range(_WORKERS)}
    assert seen == {f"{tmp_path / 'thing'} whole"}


def test_what_failed_is_made_by_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTEST_XDIST_WORKER", raising=False)
    with pytest.raises(ZeroDivisionError):
        made_once(_Factory(tmp_path), "thing", lambda folder: 1 / 0)  # type: ignore[arg-type]
    assert not (tmp_path / "thing").exists()
    folder = made_once(_Factory(tmp_path), "thing", lambda folder: (folder / "result").touch())  # type: ignore[arg-type]
    assert folder == tmp_path / "thing" and (folder / "result").exists()


def test_no_two_graphs_share_a_domain() -> None:
    with own_domain() as one, own_domain() as other:
        assert one != other
    with own_domain() as again:
        assert again == one, "a domain that was left is free"

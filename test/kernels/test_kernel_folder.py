"""Kernels that are compiled for a named processor are found on every machine."""

import llvmlite.binding
import numba
import pytest

from bodycam_ros.kernels.kernel_folder import folder_name


def named_here(monkeypatch: pytest.MonkeyPatch, host: str, processor: str | None, features: str | None) -> str:
    """The folder's name on a machine of that kind, with NUMBA_CPU_NAME and NUMBA_CPU_FEATURES, if they are set."""
    flags = {name: host == "zen" for name in ("avx512f", "avx2")}
    monkeypatch.setattr(llvmlite.binding, "get_host_cpu_name", lambda: host)
    monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", lambda: llvmlite.binding.FeatureMap(flags))
    monkeypatch.setattr(numba.config, "CPU_NAME", processor)
    monkeypatch.setattr(numba.config, "CPU_FEATURES", features)
    return folder_name.__wrapped__()


def test_by_default_every_kind_of_machine_has_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    names = {named_here(monkeypatch, host, None, None) for host in ("zen", "atom")}
    assert len(names) == 2


def test_a_named_processor_serves_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in the Docker image, where no feature is named beside it."""
    names = {named_here(monkeypatch, host, "x86-64-v3", "") for host in ("zen", "atom")}
    assert len(names) == 1
    assert named_here(monkeypatch, "zen", "x86-64-v2", "") not in names

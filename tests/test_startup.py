"""Start-up: what the import leaves for later, and the cache of compiled code. Each in a process of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba import config
from numba.core.caching import IndexDataCacheFile

import aframe_env
from aframe_env.dynamics.compiling import kernel

PACKAGE = Path(aframe_env.__file__).parent
SMALL = "from aframe_env import Sea; print(Sea(hs=2.0, tp=8.0).waves().frequency.tolist())"
"""Needs one kernel alone."""
MESSAGE = "compiling the physics"


def start(code: str, **variables: str | Path) -> subprocess.Popen[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment |= {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(PACKAGE.parent)}
    environment |= {name: str(value) for name, value in variables.items()}
    return subprocess.Popen(
        [sys.executable, "-P", "-c", code], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def run(code: str, **variables: str | Path) -> tuple[str, str]:
    """What a process writes to standard output and standard error."""
    process = start(code, **variables)
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    return output, errors


@pytest.fixture
def read_only(tmp_path: Path) -> Path:
    """Folder with a copy of the package that nothing can be written into, not even by root."""
    shutil.copytree(PACKAGE, tmp_path / "site" / "aframe_env", ignore=shutil.ignore_patterns("__pycache__"))
    for source in [*(tmp_path / "site").rglob("*.py")]:
        (source.parent / "__pycache__").touch()
    return tmp_path / "site"


def test_import_registers_and_leaves_the_slow_libraries_for_later() -> None:
    code = """
import sys, gymnasium, aframe_env
print(gymnasium.spec("AFrameHeave-v0").entry_point)
print([name for name in ("torch", "numba", "scipy", "stable_baselines3", "matplotlib") if name in sys.modules])
"""
    assert run(code)[0].split("\n")[:2] == ["aframe_env.env:AFrameHeaveEnv", "[]"]


def test_first_reset_needs_neither_torch_nor_the_slow_parts_of_scipy() -> None:
    code = """
import sys, gymnasium
gymnasium.make("aframe_env:AFrameHeave-v0").reset(seed=0)
print([name for name in ("torch", "scipy.interpolate", "scipy.optimize") if name in sys.modules])
"""
    assert run(code)[0] == "[]\n"


def test_every_exported_name_can_be_had() -> None:
    stub = (PACKAGE / "__init__.pyi").read_text(encoding="utf-8")
    listed = stub.partition("__all__ = ")[2]
    assert sorted(aframe_env.__all__) == sorted(eval(listed))
    for name in aframe_env.__all__:
        assert getattr(aframe_env, name) is not None
        assert name in dir(aframe_env)
    with pytest.raises(AttributeError, match="Scenarios"):
        aframe_env.Scenarios  # type: ignore[attr-defined]  # noqa: B018


def test_compiling_is_announced_once_and_a_warm_start_is_silent(tmp_path: Path) -> None:
    cold, announced = run(SMALL, NUMBA_CACHE_DIR=tmp_path)
    assert announced.count(MESSAGE) == 1
    assert str(tmp_path) in announced
    assert run(SMALL, NUMBA_CACHE_DIR=tmp_path) == (cold, "")


def test_others_functions_are_not_announced(tmp_path: Path) -> None:
    code = "import aframe_env.dynamics.compiling, numba; print(numba.njit(lambda x: x + 1)(1))"
    assert run(code, NUMBA_CACHE_DIR=tmp_path) == ("2\n", "")


def test_a_read_only_install_keeps_its_cache_in_the_users_folder(tmp_path: Path, read_only: Path) -> None:
    home = {"PYTHONPATH": read_only, "HOME": tmp_path / "home", "XDG_CACHE_HOME": tmp_path / "home" / "cache"}
    code = SMALL + "; import aframe_env; print(aframe_env.__file__)"
    cold, announced = run(code, **home)
    assert str(read_only) in cold
    assert MESSAGE in announced
    assert list((tmp_path / "home").rglob("*.nbc"))
    assert not list(read_only.rglob("*.nbc"))
    assert run(code, **home) == (cold, "")


def test_without_any_cache_folder_it_still_runs_and_says_so(tmp_path: Path, read_only: Path) -> None:
    nowhere = tmp_path / "file"
    nowhere.touch()
    output, announced = run(SMALL, PYTHONPATH=read_only, HOME=nowhere, XDG_CACHE_HOME=nowhere)
    assert "NUMBA_CACHE_DIR" in announced
    assert output == run(SMALL)[0]


def test_a_change_of_what_a_kernel_calls_compiles_it_anew(tmp_path: Path) -> None:
    shutil.copytree(PACKAGE, tmp_path / "aframe_env", ignore=shutil.ignore_patterns("__pycache__"))
    before, _ = run(SMALL, PYTHONPATH=tmp_path)
    called = tmp_path / "aframe_env" / "dynamics" / "random.py"
    source = called.read_text(encoding="utf-8")
    called.write_text(source.replace("/ 9007199254740992.0", "/ 18014398509481984.0"), encoding="utf-8")
    after, announced = run(SMALL, PYTHONPATH=tmp_path)
    assert MESSAGE in announced
    assert after != before


def test_two_processes_compile_at_once(tmp_path: Path) -> None:
    both = [start(SMALL, NUMBA_CACHE_DIR=tmp_path) for _ in range(2)]
    outputs = [process.communicate(timeout=120)[0] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert run(SMALL, NUMBA_CACHE_DIR=tmp_path) == (outputs[0], "")
    assert outputs[0] == outputs[1]


def scaled(lanes: float):  # type: ignore[no-untyped-def]
    @kernel
    def scale(x: float) -> float:
        return lanes * x

    return scale


def test_two_variants_saved_at_once_do_not_take_each_others_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    with monkeypatch.context() as at_once:
        # Both processes find an empty index, and write their code after both have written theirs.
        pending = []
        at_once.setattr(IndexDataCacheFile, "_load_index", lambda self: {})
        at_once.setattr(IndexDataCacheFile, "_save_data", lambda *arguments: pending.append(arguments))
        assert scaled(1.0)(3.0) == 3.0
        assert scaled(64.0)(3.0) == 192.0
    for file, name, data in reversed(pending):
        file._save_data(name, data)
    later = scaled(1.0), scaled(64.0)
    assert [function(3.0) for function in later] == [3.0, 192.0]
    assert [sum(function.stats.cache_hits.values()) for function in later] == [1, 1]

"""Start-up: what the import leaves for later, and the cache of compiled code. Each in a process of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
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


def test_a_second_process_compiles_no_step_anew(tmp_path: Path) -> None:
    """What is in the cache must not depend on the process: its kernels' names and their keys are the same in all."""
    code = """
import gymnasium, numpy
env = gymnasium.make("aframe_env:AFrameHeave-v0")
env.reset(seed=0)
print(env.step(numpy.zeros(1, dtype=numpy.float32))[0].tolist())
"""
    # Less optimised, it compiles sooner, and is kept the same way.
    how = {"NUMBA_CACHE_DIR": tmp_path, "NUMBA_OPT": "1"}
    cold, announced = run(code, **how)
    assert MESSAGE in announced
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb?")}
    assert any("step_kernels" in path.name for path in kept)
    assert run(code, **how) == (cold, "")
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb?")} == kept


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


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder of compiled code, and what SMALL writes."""
    folder = tmp_path_factory.mktemp("compiled")
    return folder, run(SMALL, NUMBA_CACHE_DIR=folder)[0]


@pytest.fixture
def kept(tmp_path: Path, compiled: tuple[Path, str]) -> Path:
    """A copy of that folder."""
    return Path(shutil.copytree(compiled[0], tmp_path / "kept"))


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def scrambled(path: Path) -> None:
    path.write_bytes(np.random.default_rng(1).bytes(path.stat().st_size))


def one_bit_turned(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize("damage", [truncated, emptied, scrambled, one_bit_turned])
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_a_damaged_file_of_compiled_code_is_named_once_and_made_anew(
    kept: Path, compiled: tuple[Path, str], ending: str, damage: Callable[[Path], None]
) -> None:
    _, right = compiled
    files = list(kept.rglob(f"*.{ending}"))
    whole = [path.read_bytes() for path in files]
    for path in files:
        damage(path)
    assert files
    assert whole != [path.read_bytes() for path in files]
    mended, said = run(SMALL, NUMBA_CACHE_DIR=kept)
    assert mended == right
    assert said.count("is damaged and is compiled anew") == 1
    assert str(files[0].parent) in said
    assert run(SMALL, NUMBA_CACHE_DIR=kept) == (right, "")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such rights")
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_compiled_code_that_cannot_be_read_is_made_anew(kept: Path, compiled: tuple[Path, str], ending: str) -> None:
    _, right = compiled
    for path in kept.rglob(f"*.{ending}"):
        path.chmod(0)
    mended, said = run(SMALL, NUMBA_CACHE_DIR=kept)
    assert mended == right
    # Root reads whatever there is.
    assert ("cannot be read" in said) == (os.getuid() != 0)
    assert run(SMALL, NUMBA_CACHE_DIR=kept) == (right, "")


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_compiled_code_that_can_be_neither_read_nor_kept_is_told_of(
    kept: Path, compiled: tuple[Path, str], ending: str
) -> None:
    _, right = compiled
    for path in kept.rglob(f"*.{ending}"):
        path.unlink()
        path.mkdir()
    output, said = run(SMALL, NUMBA_CACHE_DIR=kept)
    assert output == right
    assert "cannot be read" in said
    assert "cannot be kept" in said


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

"""Measuring scripts as processes: started once, pinned, kept warm, asked for one sample at a time."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.catalogue import Interpreter, Script

ROOT: Final = Path(__file__).parents[1]
TIMEOUT: Final = 900.0
"""Longest wait for an answer, s: building what is measured is part of the first."""
THREADS: Final = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class NotMeasured(RuntimeError):
    """Reason why there is no sample, in a line."""


@dataclass(frozen=True)
class Pythons:
    """Interpreters of the scripts."""

    peers: Path
    """Interpreter of the peers' environment."""

    def command(self, script: Script) -> list[str]:
        """Command line of a script. The peers' are files; the package's are modules of this package."""
        kind: Interpreter = script.interpreter
        if kind == "peers":
            return [str(self.peers), script.path]
        if script.path.startswith("benchmarks/peers/"):
            return [sys.executable, script.path]
        return [sys.executable, "-m", script.path.removesuffix(".py").replace("/", ".")]

    def failures(self) -> dict[str, str]:
        """Packages that could not be installed for the peers, with the first line of the error."""
        path = self.peers.parents[1] / "failures.json"
        return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def available_cores() -> list[int]:
    """Cores that this process may use; empty where the system does not say."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []


class Worker:
    """One script on some cores."""

    def __init__(self, script: Script, cores: int, pythons: Pythons) -> None:
        """Start it; raises NotMeasured if it does not come up."""
        self.versions: dict[str, str] = {}
        self._pythons = pythons
        allowed = available_cores()
        if allowed and len(allowed) < cores:
            raise NotMeasured(f"needs {cores} cores, there are {len(allowed)}")
        self._errors = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace")  # noqa: SIM115
        environment = {**os.environ, **dict.fromkeys(THREADS, str(cores)), "PYTHONUNBUFFERED": "1"}
        if script.interpreter == "peers":
            environment.pop("PYTHONPATH", None)
        if allowed:
            os.sched_setaffinity(0, allowed[:cores])  # which the child inherits
        try:
            self._process = subprocess.Popen(
                [*pythons.command(script), "--serve"],
                cwd=ROOT,
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                text=True,
                start_new_session=True,  # an interrupt is for the run, which then ends its workers
            )
        except OSError as error:
            self._errors.close()
            raise NotMeasured(f"{Path(pythons.command(script)[0]).name}: {error.strerror}") from error
        finally:
            if allowed:
                os.sched_setaffinity(0, allowed)
        try:
            self.versions = dict(self._answer()["versions"])
        except NotMeasured:
            self.close()
            raise

    def sample(self, name: str) -> float:
        """Take one sample, in the measure's unit; raises NotMeasured."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(name + "\n")
            self._process.stdin.flush()
        except OSError:
            raise NotMeasured(self._last_words()) from None
        answer = self._answer()
        if "error" in answer:
            raise NotMeasured(self._explained(str(answer["error"])))
        return float(answer["value"])

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdout.close()
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.close()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        readable, _, _ = select.select([self._process.stdout], [], [], TIMEOUT)
        if not readable:
            self._process.kill()
            raise NotMeasured(f"no answer within {TIMEOUT:g} s")
        line = self._process.stdout.readline()
        if not line:
            raise NotMeasured(self._last_words())
        return dict(json.loads(line))

    def _last_words(self) -> str:
        """Last line of the error output, where Python says what was wrong."""
        self._process.wait()
        self._errors.seek(0)
        lines = [line.strip() for line in self._errors if line.strip()]
        return self._explained(lines[-1] if lines else f"ended with status {self._process.returncode}")

    def _explained(self, error: str) -> str:
        """Add the reason, where a package is missing because it could not be installed."""
        if "No module named" in error:
            for package, reason in self._pythons.failures().items():
                if package.partition("==")[0] in error:
                    return f"{package} could not be installed: {reason}"
        return error

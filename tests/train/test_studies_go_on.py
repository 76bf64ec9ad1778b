"""Commands that are killed between their jobs: the same command goes on, and nothing is lost or done twice."""

import importlib

import pytest

from benchmarks.torture.studies import MEASURED, contents
from train.shared.job_store import JobStore
from train.verify import __main__ as verify
from train.verify import frame_checks

COMMANDS = {
    "train.tune_control": ("--policies", "state", "inverse-dynamics", "--scenarios", "2", "--evaluations", "4"),
    "train.sensitivity.__main__": (
        *("--policies", "drum still", "H-Ω1", "drive map", "--scenarios", "1", "--points", "2"),
        *("--samples", "2", "--optimiser", "gauss-newton", "--workers", "1"),
    ),
    "train.optimisers": (
        *("--scenarios", "0", "--max-evaluations", "50", "--limited", "1", "--limited-evaluations", "2"),
        *("--workers", "1"),
    ),
    "train.drives.__main__": (
        *("--case", "paper", "--drive", "harmonic", "--objective", "omega1", "--duration", "6"),
        *("--max-evaluations", "40", "--check", "rfem"),
    ),
    "train.verify.__main__": (),
}
LONG = ("train.optimisers", "train.verify.__main__")
FOLDER = {"train.verify.__main__": "--folder"}


class Killed(BaseException):
    """What a process that is killed never sees."""


def command(name, folder, monkeypatch):
    folder.mkdir(exist_ok=True)
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.argv", [name, *COMMANDS[name], FOLDER.get(name, "--out"), "out"])
    return importlib.import_module(name).main()


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow if name in LONG else ()) for name in COMMANDS],
)
def test_a_killed_command_goes_on_and_ends_with_the_same_bytes(name, tmp_path, monkeypatch, capsys):
    if name == "train.sensitivity.__main__":
        pytest.importorskip("SALib", reason="needs the extra sensitivity")
    monkeypatch.setattr(verify, "CHECKS", (frame_checks.determinate_reactions, frame_checks.static_frame))
    write, written = JobStore.write, []

    def kept(store, key, result):
        write(store, key, result)
        written.append(key)
        if len(written) in deadly:
            raise Killed

    monkeypatch.setattr(JobStore, "write", kept)
    deadly: tuple[int, ...] = ()
    assert command(name, tmp_path / "whole", monkeypatch) == 0
    jobs = len(written)
    written.clear()
    deadly = (1, jobs)
    for _ in deadly:
        with pytest.raises(Killed):
            command(name, tmp_path / "parts", monkeypatch)
    assert command(name, tmp_path / "parts", monkeypatch) == 0
    assert len(set(written)) == len(written) == jobs
    measured = MEASURED.get(name.removesuffix(".__main__"), ())
    whole = contents(tmp_path / "whole" / "out", measured)
    assert contents(tmp_path / "parts" / "out", measured) == whole
    assert "jobs.sqlite" not in whole
    with pytest.raises(SystemExit):
        command(name, tmp_path / "parts", monkeypatch)
    assert "this run is finished; pass --overwrite to do it again" in capsys.readouterr().err

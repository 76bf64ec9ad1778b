"""Where the figures of a training go: a CSV file always, and what ``--log`` names."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

import numpy as np
from gymnasium.error import DependencyNotInstalled
from stable_baselines3.common.logger import CSVOutputFormat, KVWriter, Logger, configure

from aframe_env.text import read_csv
from aframe_env.validation import InvalidValue
from train.shared.run_folder import naming

LOGS: Final = ("tensorboard", "wandb", "mlflow")
PROJECT: Final = "aframe-heave"
"""Project of Weights & Biases, experiment of MLflow, unless the environment names another."""

Log = Callable[[dict[str, float], int], object]
"""Takes figures by name, and the control steps after which they were so."""


class Figures(KVWriter):
    """Hands the numbers of a Stable-Baselines3 logger to a tracker."""

    def __init__(self, tracker: str, log: Log) -> None:
        self._tracker, self._log = tracker, log

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        """Hand on what is a number and is not kept from this tracker."""
        figures = {
            key: float(value)
            for key, value in key_values.items()
            if isinstance(value, int | float | np.number) and self._tracker not in (key_excluded[key] or ())
        }
        self._log(figures, step)

    def close(self) -> None:
        """Leave the tracker's run to ``open_logger``, which knows how it ended."""


def require_logs(names: Sequence[str]) -> None:
    """Raise unless every log is known, its package is there, and its tracker takes runs; writes no run."""
    for name in names:
        if name not in LOGS:
            raise InvalidValue(f"log = {name!r}: must be among {', '.join(LOGS)}, as in --log tensorboard wandb")
        try:
            # Not find_spec: a folder "wandb" of earlier runs would do for that.
            version(name)
        except PackageNotFoundError as error:
            raise DependencyNotInstalled(f'{name} is not installed: pip install "aframe-heave[{name}]"') from error
    if "wandb" in names:
        _require_wandb()
    if "mlflow" in names:
        _require_mlflow()


@contextmanager
def open_logger(folder: Path, names: Sequence[str], options: Mapping[str, Any], begun: int = 0) -> Iterator[Logger]:
    """Open a run of every log for a training with these options, whose run folder is ``folder``.

    ``begun``: control steps that were learned from before an interruption; their figures stay.
    """
    with naming(folder / "log", unless_named=True), _told_once(), ExitStack() as stack:
        earlier = _figures_until(begun, folder / "log" / "progress.csv")
        logger = configure(str(folder / "log"), ["csv", *(["tensorboard"] if "tensorboard" in names else [])])
        stack.callback(logger.close)
        if earlier:
            _write_again(earlier, logger)
        for name, open_run in _TRACKERS.items():
            if name in names:
                logger.output_formats.append(Figures(name, stack.enter_context(open_run(folder, options))))
        yield logger


@contextmanager
def _told_once() -> Iterator[None]:
    """Leave errors of the disk to who learns: TensorBoard's thread hands them on, and prints a traceback."""
    before = threading.excepthook

    def tell(args: threading.ExceptHookArgs) -> None:
        if not isinstance(args.exc_value, OSError):
            before(args)

    threading.excepthook = tell
    try:
        yield
    finally:
        threading.excepthook = before


def _figures_until(timesteps: int, path: Path) -> list[dict[str, str]]:
    """Lines of the CSV file of figures up to so many control steps."""
    if not timesteps or not path.exists():
        return []
    rows = [cells for _, cells in read_csv(path, "log")]
    lines = [dict(zip(rows[0], cells, strict=False)) for cells in rows[1:]]  # the last may have been cut off
    return [line for line in lines if 0 < _whole(line.get("time/total_timesteps")) <= timesteps]


def _whole(cell: str | None) -> int:
    """Number of control steps that a cell says; 0 if none."""
    return int(cell) if cell is not None and cell.isdecimal() else 0


def _write_again(lines: Sequence[Mapping[str, str]], logger: Logger) -> None:
    """Put lines at the start of the logger's new CSV file."""
    (output,) = (each for each in logger.output_formats if isinstance(each, CSVOutputFormat))
    for line in lines:
        figures = {key: value for key, value in line.items() if value}
        output.write(figures, dict.fromkeys(figures, ()))


def _require_wandb() -> None:
    import wandb

    with _in_one_sentence("wandb", wandb.Error, "say `wandb login`, or set WANDB_MODE=offline"):
        wandb.login()


def _require_mlflow() -> None:
    import mlflow

    help_ = f"{mlflow.get_tracking_uri()} takes no runs; set MLFLOW_TRACKING_URI=sqlite:///mlflow.db, or to a server"
    with _in_one_sentence("mlflow", mlflow.MlflowException, help_):
        mlflow.set_experiment(os.environ.get("MLFLOW_EXPERIMENT_NAME", PROJECT))


@contextmanager
def _in_one_sentence(name: str, kind: type[Exception], help_: str) -> Iterator[None]:
    try:
        yield
    except kind as error:
        reason = str(error).strip().partition("\n")[0].partition(". ")[0].rstrip(".")
        raise InvalidValue(f"log = {name!r}: {reason}; {help_}") from error


@contextmanager
def _wandb(folder: Path, options: Mapping[str, Any]) -> Iterator[Log]:
    import wandb

    with _in_one_sentence("wandb", wandb.Error, "set WANDB_MODE=offline"):
        opened = wandb.init(
            project=os.environ.get("WANDB_PROJECT", PROJECT),
            name=str(folder),
            dir=folder / "log",
            config=dict(options),
            # The terminal belongs to the bar of progress.
            settings=wandb.Settings(console="off"),
        )
    with opened as run:
        yield lambda figures, step: run.log(figures, step=step)


@contextmanager
def _mlflow(folder: Path, options: Mapping[str, Any]) -> Iterator[Log]:
    import mlflow

    with mlflow.start_run(run_name=str(folder)) as run:
        mlflow.log_params(dict(options))
        # In the background: a server that is slow or goes away must not cost a training.
        yield lambda figures, step: mlflow.log_metrics(figures, step=step, run_id=run.info.run_id, synchronous=False)
        mlflow.flush_async_logging()


_TRACKERS: Final[dict[str, Callable[[Path, Mapping[str, Any]], AbstractContextManager[Log]]]] = {
    "wandb": _wandb,
    "mlflow": _mlflow,
}

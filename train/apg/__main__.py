"""Train a recurrent agent by the gradient of its score: ``python -m train.apg --task Storm --out runs/apg``.

Four stages: episodes are recorded with the real engine; the network learns to foretell the pulley's motion from the
readings; it imitates the winch-limited optimum in the states that it visits; and the gradient of the score, through a
linear twin of rope and winch, does the rest. The agent that is best on the validation scenarios, in the real engine,
is written. What is finished is kept: the same command goes on after an interruption.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import Final

from rich.console import Console

from aframe_env.validation import InvalidValue
from agents.learned.recurrent import CARD, WEIGHTS, card_text
from train.apg.data import require_known
from train.apg.options import ApgOptions
from train.apg.stages import Training, to_policy
from train.shared.cli import parse, read_options
from train.shared.console import PlainConsole
from train.shared.run_folder import CONFIG, open_run, user_errors, write_agent, write_json

COMMAND: Final = "train.apg"
METRICS: Final = "metrics.json"


def train(options: ApgOptions, console: Console) -> None:
    """Train the agents of all seeds, or go on with that."""
    require_known(options.training_scenarios(0, 1))  # before anything is written
    if options.seeds == 1:
        return train_one(options, console)
    opened = open_run(options, COMMAND, goes_on=True)
    opened.record(options)
    for seed in range(options.seed, options.seed + options.seeds):
        out = opened.folder / f"seed-{seed}"
        if opened.taken_up and (out / METRICS).exists():
            console.print(f"{out}: finished")
        else:
            train_one(replace(options, seed=seed, seeds=1, out=out), console)
    return None


def train_one(options: ApgOptions, console: Console) -> None:
    """Train one agent, and write it."""
    opened = open_run(options, COMMAND, goes_on=True)
    folder = opened.folder
    if opened.taken_up and (folder / METRICS).exists():
        raise InvalidValue(f"out = {str(folder)!r}: this training is finished; pass --overwrite to do it again")
    console.print(f"run folder: {folder}")
    training = Training(options, folder, console)
    if not opened.taken_up:
        (folder / METRICS).unlink(missing_ok=True)
        training.remove()
        opened.record(options)
    begin = time.perf_counter()
    best = training.run()
    policy, weights = to_policy(best.network, options)
    write_agent(folder / WEIGHTS, weights, folder / CARD, card_text(policy.card))
    seconds = round(time.perf_counter() - begin, 1)
    write_json(folder / METRICS, {"seconds": seconds, "looks": best.looks})
    training.remove()
    console.print(f"agent: {folder / WEIGHTS} after {seconds:.0f} s")


def _options() -> ApgOptions:
    """Options of the command line, or those of the training that it goes on with."""
    options = parse(ApgOptions, COMMAND, __doc__ or "")
    folder = options.resume
    if folder is None:
        return options
    if not (folder / CONFIG).is_file():
        raise InvalidValue(f"resume = {str(folder)!r}: no folder of a training, which has {CONFIG}")
    # What was begun with --overwrite must not be overwritten now.
    return replace(read_options(folder / CONFIG, ApgOptions), out=folder, overwrite=False)


def main() -> int:
    """Run the command."""
    with user_errors():
        train(_options(), PlainConsole())
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Rows on a GPU: env steps a second against their number, and seconds of learning until 95 % and 98 % heave reduction.

``python -m benchmarks.gpu`` (extra ``cuda``) writes results/benchmark-gpu.json. Without a GPU it says so and measures
nothing. Whole environment steps are timed: dynamics, observation, reward, and the resets of rows whose episodes end, at
random times, with their new seas. The peer of their memory traffic is the card's own copy of a large tensor.
"""

from __future__ import annotations

import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from rich.console import Console

from aframe_env.cuda.device import open_device
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.scenario import ScenarioDistribution
from aframe_env.torch_env import AFrameHeaveTorchEnv
from aframe_env.validation import require_integer, require_number
from benchmarks import learner
from train.learn import ppo_rsl
from train.learn.trained import to_policy
from train.shared.cli import parse
from train.shared.run_folder import user_errors, versions, write_json

PERIOD: Final = 0.1
WARM: Final = 10
"""Steps before the clock starts: the first ones compile."""


@dataclass(frozen=True)
class Options:
    """Measures of a run, and their number of samples."""

    rows: tuple[int, ...] = (1024, 4096, 16_384, 65_536, 262_144, 1_048_576)
    """Rows of the environment."""
    steps: int = 100
    """Steps of a sample."""
    rounds: int = 5
    """Samples of each number of rows."""
    targets: tuple[float, ...] = (0.95, 0.98)
    """Median heave reductions over validation scenarios to learn up to; none leaves the learning out."""
    scenarios: int = 64
    """Validation scenarios."""
    limit: float = 600.0
    """Time after which a learner is given up, s."""
    out: Path = Path("results/benchmark-gpu.json")
    """File of the figures."""

    def __post_init__(self) -> None:
        for rows in self.rows:
            require_integer("rows", rows, low=1, high=2**24)
        require_integer("steps", self.steps, low=1, high=10**6)
        require_integer("rounds", self.rounds, low=1, high=1000)
        require_number("limit", self.limit, "s", low=0.0, high=1e6)


@dataclass(frozen=True)
class Speed:
    """Figures of one number of rows."""

    rows: int
    steps_per_second: list[float]
    """Env steps a second, over all rows, one a round."""
    bandwidth_share: float
    """Share of the card's copy bandwidth that moving a row's memory once a step takes (see ``bytes_moved``); median."""
    bytes_a_row: float | None
    """Memory of the device a row, at its most; None on the processor."""


@dataclass(frozen=True)
class Learned:
    """One run of the learner."""

    target: float
    """Median heave reduction to reach."""
    reached: bool
    seconds: float
    """Learning until the target, or until given up."""
    timesteps: int
    reductions: list[float]
    """Median heave reduction at each look."""


def finish(device: torch.device) -> float:
    """Wait for the device; s of a clock."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)
    return time.perf_counter()


def copy_bandwidth(device: torch.device, size: int = 2**27) -> float:
    """Bytes a second, read and written, of the best of ten copies of ``size`` float64."""
    source = torch.zeros(size, dtype=torch.float64, device=device)
    target = torch.ones_like(source)
    best = np.inf
    for _ in range(10):
        begin = finish(device)
        target.copy_(source)
        best = min(best, finish(device) - begin)
    return 16.0 * size / best


def bytes_moved(source: ScenarioDistribution) -> float:
    """Memory traffic of a step if each of a row's slots moved once: its own read and written, its waves' at knots."""
    engine, rng = Engine(1, PERIOD, source.components), np.random.default_rng(0)
    knots = np.mean([1.0 / engine.row_vector(source.draw(rng))[at.NODE_SEGMENTS] for _ in range(100)])
    waves = at.padded(source.components) * (at.COMPONENT_SLOTS + 2)  # the phases are written, too
    return float(8 * (2 * at.ROW_SLOTS + knots * waves))


def measure(rows: int, options: Options, device: torch.device, bandwidth: float) -> Speed:
    """Time steps of so many rows."""
    if device.type == "cuda":
        torch.cuda.empty_cache()
        torch.cuda.reset_peak_memory_stats(device)
    env = AFrameHeaveTorchEnv(rows, control_period=PERIOD, device=device)
    env.episode_length_buf = torch.randint_like(env.episode_length_buf, high=env.max_episode_length)
    actions = torch.rand((rows, 1), device=device) - 0.5
    for _ in range(WARM):
        env.step(actions)
    samples = []
    for _ in range(options.rounds):
        begin = finish(device)
        for _ in range(options.steps):
            env.step(actions)
        samples.append(rows * options.steps / (finish(device) - begin))
    share = float(np.median(samples)) * bytes_moved(ScenarioDistribution()) / bandwidth
    most = torch.cuda.max_memory_allocated(device) / rows if device.type == "cuda" else None
    return Speed(rows, samples, share, most)


def learn(target: float, options: Options, chosen: ppo_rsl.Options) -> Learned:
    """Learn until the target; the clock stands still while it is looked at."""
    built = ppo_rsl.build(chosen)
    course = learner.Course("state", options.scenarios)
    clock = learner.Clock(lambda: to_policy(built, chosen)[0], course, target, options.limit)
    built.model.learn(chosen.timesteps, callback=clock)
    return Learned(target, clock.reached, clock.seconds, built.model.num_timesteps, clock.reductions)


def run(options: Options, device: torch.device, chosen: ppo_rsl.Options, console: Console) -> None:
    """Measure, print and write."""
    bandwidth = copy_bandwidth(device)
    name = torch.cuda.get_device_name(device) if device.type == "cuda" else "processor"
    console.print(f"{name}: copies {bandwidth / 1e9:,.0f} GB/s")
    speeds = []
    for rows in options.rows:
        speeds.append(measure(rows, options, device, bandwidth))
        median, share = np.median(speeds[-1].steps_per_second), speeds[-1].bandwidth_share
        console.print(f"{rows:,} rows: {median:,.0f} env steps/s, {share:.1%} of the copy bandwidth")
    runs = []
    for target in options.targets:
        runs.append(learn(target, options, chosen))
        end = f"{runs[-1].seconds:.1f} s" if runs[-1].reached else "given up"
        console.print(f"{target:.0%} heave reduction: {end}, {runs[-1].timesteps:,} steps")
    write_json(
        options.out,
        {
            "device": name,
            "copy_bytes_per_second": bandwidth,
            "speeds": [asdict(speed) for speed in speeds],
            "learning": [asdict(one) for one in runs],
            "versions": versions(),
        },
    )
    console.print(f"written: {options.out}")


def main() -> int:
    """Run the command."""
    with user_errors():
        options = parse(Options, "benchmarks.gpu", __doc__ or "")
        run(options, open_device("cuda"), ppo_rsl.Options(), Console())
    return 0


if __name__ == "__main__":
    sys.exit(main())

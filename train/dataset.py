"""Make Minari data sets of episodes for offline learning: ``python -m train.dataset`` (extra ``data``).

Makes ``aframe-heave/{state,sensors}-{expert,medium,noisy}-v0``, or with ``--policy`` one set of any policy, by name,
folder or module:function, as for ``train.evaluate``. The sets lie where Minari looks for them: in
``MINARI_DATASETS_PATH``, else in ``~/.minari/datasets``. Episode k is that of ``env.reset(seed=1000000 * SEED + k)``;
none of these seeds draws a held-out scenario.
"""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, Literal

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.error import DependencyNotInstalled
from gymnasium.utils import seeding
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from aframe_env import ENV_ID, __version__, task
from aframe_env.config import TaskConfig
from aframe_env.simulation import Simulation
from aframe_env.validation import InvalidValue, require_integer, require_number
from agents.control.feed_forward import PartialFeedForward
from agents.learned.agent import LearnedPolicy
from agents.policy import DrumStill, Policy, begin
from agents.registry import BuildContext, PolicySpec, as_spec, choose, slug
from train.evaluate.run import observation_of
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.run_folder import command_line, naming, user_errors, write_json

if TYPE_CHECKING:
    from minari.data_collector import EpisodeBuffer

Kind = Literal["expert", "medium", "noisy"]
Observed = Literal["state", "sensors"]

NAMESPACE: Final = "aframe-heave"
EXPERTS: Final[dict[Observed, str]] = {"state": "predictive-ppo", "sensors": "predictive-ppo-sensors"}
"""The shipped agents that the expert sets are of."""
NOISE: Final = 0.1
"""Standard deviation of the noise on the expert's action in the noisy sets, rad/s."""
SEED_STRIDE: Final = 1_000_000
"""Seeds from one series of episodes to the next. None of them draws a held-out scenario, see ``MOST_EPISODES``."""
MOST_EPISODES: Final = 50_000
"""Fewer than the last digits of ``agents.rollout.HELD_OUT_SEED``, 91123, so that no series reaches it."""
MOST_SERIES: Final = 4000
"""The seeds stay below 2³²: a larger one can be the same to NumPy as that of a held-out scenario."""
_CODE: Final = f"https://github.com/aframe-heave/aframe-heave/blob/v{__version__}/train/dataset.py"
_ROWS: Final = 256
"""Episodes that run in step."""

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Options:
    """The sets, and what is in them."""

    kinds: tuple[Kind, ...] = ("expert", "medium", "noisy")
    """expert: a shipped agent, predictive PPO; medium: a drum that takes up three quarters of the pulley's velocity;
    noisy: the expert with noise on its action."""
    observations: tuple[Observed, ...] = ("state", "sensors")
    """Observations to make sets of."""
    policy: str | None = None
    """Make one set of this policy instead: its name, a folder, or module:function. One that is made for neither
    observation gets the first of --observations."""
    noise: float | None = None
    """Standard deviation of the normal noise on the action, rad/s: of the noisy sets (0.1 by default), or of the set of
    --policy (none by default)."""
    episodes: int = 200
    """Episodes of a set."""
    seed: int = 0
    """Series of episodes: the first one's seed is 1000000 times this."""
    scenario: Path | None = None
    """TOML file with a scenario or a distribution of your own; its name is added to the sets' names."""
    overwrite: bool = False
    """Replace sets that exist."""

    def __post_init__(self) -> None:
        if self.noise is not None:
            require_number("noise", self.noise, "rad/s", low=0.0, high=100.0)
        require_integer("episodes", self.episodes, low=1, high=MOST_EPISODES)
        require_integer("seed", self.seed, low=0, high=MOST_SERIES)
        if not (self.kinds and self.observations):
            raise InvalidValue("kinds, observations: at least one of each, as in --kinds expert --observations state")


class PatientFile(io.FileIO):
    """A file that HDF5 can always write and close; what went wrong is raised when it is done.

    HDF5 cannot close a file that it cannot write: it prints tracebacks, tries again, and may crash.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "r+")
        self._error: OSError | KeyboardInterrupt | None = None

    def write(self, data: Any) -> int:
        """Write bytes, or let them go once the disk is full."""
        left = memoryview(data)
        try:
            while self._error is None and left.nbytes:
                left = left[super().write(left) :]
        except (OSError, KeyboardInterrupt) as error:
            self._error = error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        """Set the file's size in bytes, or let it be once the disk is full."""
        try:
            if self._error is None:
                return super().truncate(size)
        except (OSError, KeyboardInterrupt) as error:
            self._error = error
        return size or 0

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Raise what went wrong with the file in here, at the end, in place of what HDF5 makes of it."""
        try:
            yield
        finally:
            if self._error is not None:
                raise self._error


@dataclass(frozen=True)
class Recipe:
    """What one set is made of."""

    kind: str
    spec: PolicySpec
    config: TaskConfig
    """The task, with the observation that the policy acts on."""
    noise: float
    """rad/s."""

    @property
    def id(self) -> str:
        """Name of the set in Minari."""
        seen = "state" if self.config.sensors is None else "sensors"
        own = self.config.scenario
        parts = [seen, self.kind, *([own.stem] if isinstance(own, Path) else [])]
        return f"{NAMESPACE}/{'-'.join(re.sub(r'[^a-z0-9]+', '-', slug(part)).strip('-') for part in parts)}-v0"


def recipes(options: Options) -> list[Recipe]:
    """Return what is to be made. Raises ``InvalidValue`` where a policy or a scenario file is wrong."""

    def config(observation: Observed, spec: PolicySpec) -> TaskConfig:
        period = spec.control_period or TaskConfig.control_period
        return TaskConfig(scenario=options.scenario, observation=observation, control_period=period)

    if options.policy is not None:
        spec = choose(options.policy)
        asked = config(options.observations[0], spec)
        built = spec.build(BuildContext(scenarios=[asked.nominal], config=asked))
        seen = asked.replaced(observation=observation_of(built, asked))
        return [Recipe(options.policy.rpartition("/")[2], spec, seen, options.noise or 0.0)]
    noise = NOISE if options.noise is None else options.noise
    found = []
    for observation in options.observations:
        expert = choose(EXPERTS[observation])
        medium = as_spec(PartialFeedForward(sensors=observation == "sensors"))
        for kind in options.kinds:
            spec = medium if kind == "medium" else expert
            found.append(Recipe(kind, spec, config(observation, spec), noise if kind == "noisy" else 0.0))
    return found


def episode_seeds(series: int, count: int) -> list[int]:
    """Return the seeds of the first episodes of a series: ``env.reset(seed=...)`` begins each of them."""
    return [SEED_STRIDE * series + k for k in range(count)]


@dataclass(frozen=True)
class Recording:
    """An episode: T steps, and what was seen before and after each."""

    seed: int
    observations: npt.NDArray[np.float32]
    """(T + 1, K)."""
    actions: npt.NDArray[np.float32]
    """(T, 1) rad/s."""
    rewards: Float64
    """(T,) m² s."""
    parted: bool
    """True if it ended with a parted rope, False with its time."""
    infos: dict[str, npt.NDArray[Any]]
    """The environment's, each (T + 1, ...)."""

    def buffer(self, number: int) -> EpisodeBuffer:
        """The episode as Minari takes it."""
        from minari.data_collector import EpisodeBuffer

        last = np.arange(len(self.rewards)) == len(self.rewards) - 1
        return EpisodeBuffer(
            id=number,
            seed=self.seed,
            observations=self.observations,
            actions=self.actions,
            rewards=self.rewards,
            terminations=last & self.parted,
            truncations=last & (not self.parted),
            infos=self.infos,
        )


def begun(config: TaskConfig, seeds: Sequence[int]) -> Simulation:
    """Begin the episodes of these seeds, in step: row k is ``env.reset(seed=seeds[k])``."""
    simulation = Simulation(len(seeds), config)
    drawn = [simulation.draw(seeding.np_random(seed)[0]) for seed in seeds]
    simulation.reset_rows(np.arange(len(seeds)), drawn)
    return simulation


def record(
    simulation: Simulation,
    policy: Policy,
    seeds: Sequence[int],
    noise: Float64,
    progress: Callable[[], object] = lambda: None,
) -> list[Recording]:
    """Run a policy to the episodes' ends; ``noise`` (steps, N) rad/s is added to its actions."""
    steps, rows, period = simulation.episode_steps, simulation.rows, simulation.control_period
    begin(policy, [each for each in simulation.scenarios if each is not None], period)
    space = simulation.action_space
    seen, infos = [simulation.observe()], [_infos(simulation)]
    actions, rewards = np.empty((steps, rows, 1), dtype=np.float32), np.empty((steps, rows))
    parted = np.zeros((steps, rows), dtype=np.bool_)
    for step in range(steps):
        command = policy.act(seen[-1], step * period) + noise[step]
        actions[step] = np.clip(command[:, None], space.low, space.high)
        # What is recorded is what is done, to the last bit.
        simulation.advance(actions[step, :, 0].astype(np.float64))
        seen.append(simulation.observe())
        infos.append(_infos(simulation))
        rewards[step] = -simulation.results[:, task.COST]
        parted[step] = simulation.results[:, task.PARTED] > 0.0
        progress()
    observations = np.stack(seen)
    told = {name: np.stack([info[name] for info in infos]) for name in infos[0]}
    # A row whose rope has parted runs on, but its episode is over.
    ends = np.where(parted.any(axis=0), parted.argmax(axis=0) + 1, steps)
    return [
        Recording(
            seed=seed,
            observations=observations[: end + 1, row],
            actions=actions[:end, row],
            rewards=rewards[:end, row],
            parted=bool(parted[:end, row].any()),
            infos={name: values[: end + 1, row] for name, values in told.items()},
        )
        for row, (seed, end) in enumerate(zip(seeds, ends.tolist(), strict=True))
    ]


def _infos(simulation: Simulation) -> dict[str, npt.NDArray[Any]]:
    return task.info(simulation.results.copy(), simulation.frames())


def collected(
    recipe: Recipe, seeds: Sequence[int], progress: Callable[[], object]
) -> Iterator[tuple[Policy, list[Recording], Float64]]:
    """Yield, for a part of the seeds after another: the policy, its episodes, and Ω1 with the drum still, m² s."""
    for first in range(0, len(seeds), _ROWS):
        part = seeds[first : first + _ROWS]
        simulation = begun(recipe.config, part)
        scenarios = [each for each in simulation.scenarios if each is not None]
        policy = recipe.spec.build(BuildContext(scenarios=scenarios, config=recipe.config))
        shape = (simulation.episode_steps, len(part))
        noise = recipe.noise * np.random.default_rng([part[0], 1]).standard_normal(shape)
        episodes = record(simulation, policy, part, noise, progress)
        still = record(begun(recipe.config, part), DrumStill(), part, np.zeros(shape))
        yield policy, episodes, np.array([float(each.infos["omega1"][-1]) for each in still])


def description(recipe: Recipe, policy: Policy, command: str) -> str:
    """What is in the set, in words."""
    observation = "the full state" if recipe.config.sensors is None else "sensors' readings"
    weights = f", weights of sha256 {policy.card.sha256}" if isinstance(policy, LearnedPolicy) else ""
    noise = f", with normal noise of {recipe.noise:g} rad/s on its action" if recipe.noise else ""
    return (
        f"Active heave compensation under an offshore A-frame crane, on {observation}: {policy.name}{weights}{noise}. "
        f"Made with: {command}"
    )


def make(recipe: Recipe, options: Options, command: str, console: Console) -> None:
    """Make a set, all or nothing, and say what is in it."""
    from minari.dataset.minari_storage import MinariStorage
    from minari.namespace import NAMESPACE_METADATA_FILENAME, list_local_namespaces
    from minari.storage import get_dataset_path

    seeds = episode_seeds(options.seed, options.episodes)
    env = gymnasium.make(ENV_ID, config=recipe.config)
    root, place = get_dataset_path(), get_dataset_path(recipe.id)
    metadata: list[dict[str, float]] = []
    # Minari passes hidden folders over. This one lies on the disk that the set is to lie on.
    with naming(place), TemporaryDirectory(prefix=f".{NAMESPACE}-", dir=root) as folder, _bar(console) as progress:
        new = Path(folder) / "new"
        new.mkdir()
        storage = MinariStorage.new(
            new / "data",
            observation_space=env.observation_space,
            action_space=env.action_space,
            env_spec=env.spec,
        )
        bar = progress.add_task(recipe.id, total=recipe.config.steps * -(-len(seeds) // _ROWS))
        with PatientFile(new / "data" / "main_data.hdf5") as file:
            # Minari hands h5py whatever stands here, and that takes a file as well as its path.
            storage._file_path = file
            for policy, episodes, still in collected(recipe, seeds, lambda: progress.advance(bar)):
                with file.errors():
                    storage.update_episodes(each.buffer(len(metadata) + k) for k, each in enumerate(episodes))
                algorithm, said = policy.name, description(recipe, policy, command)
                metadata += [_scores(each, left) for each, left in zip(episodes, still.tolist(), strict=True)]
            with file.errors():
                storage.update_episode_metadata(metadata)
        storage.update_metadata(
            {
                "dataset_id": recipe.id,
                "minari_version": version("minari"),
                "author": {"The aframe-heave project"},
                "code_permalink": _CODE,
                "algorithm_name": algorithm,
                "description": said,
                "requirements": [f"aframe-heave=={__version__}"],
            }
        )
        if NAMESPACE not in list_local_namespaces():
            # Minari's own function leaves half a file on a full disk.
            about = {"description": "Active heave compensation under an offshore A-frame crane"}
            write_json(get_dataset_path(NAMESPACE) / NAMESPACE_METADATA_FILENAME, about)
        if place.exists():
            place.rename(Path(folder) / "replaced")
        new.rename(place)
    reductions = [each["heave_reduction"] for each in metadata]
    size = sum(file.stat().st_size for file in place.rglob("*"))
    console.print(
        f"{recipe.id}: {len(seeds)} episodes, {size / 1e6:.0f} MB, heave reduction {np.median(reductions):.1%} in the "
        f"median, {np.mean(reductions):.1%} in the mean",
        highlight=False,
    )


def _scores(episode: Recording, still: float) -> dict[str, float]:
    """What an episode's attributes say beside its seed: Ω1, that of the drum still, and the heave reduction."""
    omega1 = float(episode.infos["omega1"][-1])
    return {"omega1": omega1, "omega1_still": still, "heave_reduction": 1.0 - (omega1 / still) ** 0.5}


def _bar(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), console=console
    )


def run(options: Options, console: Console) -> int:
    """Make the sets, one after the other."""
    for package in ("minari", "h5py"):
        if find_spec(package) is None:
            raise DependencyNotInstalled(f'{package} is not installed: pip install "aframe-heave[data]"')
    from minari.storage import get_dataset_path

    asked, command = recipes(options), command_line("train.dataset")
    there = [recipe.id for recipe in asked if get_dataset_path(recipe.id).exists()]
    if there and not options.overwrite:
        raise InvalidValue(
            f"dataset = {there[0]!r}: exists in {str(get_dataset_path())!r}; pass --overwrite, or choose another "
            "folder with MINARI_DATASETS_PATH"
        )
    for recipe in asked:
        make(recipe, options, command, console)
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.dataset", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())

"""Catalogue of all measures: script, number of cores, unit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

Interpreter = Literal["package", "peers"]
STEPS: Final = "env steps/s"
COST_ROWS: Final = tuple(4**k for k in range(10))
"""Rows of the picture of cost against rows: 1 to 262,144."""
ENVPOOL: Final = tuple(
    f"{kind}-{rows}-{threads}" for rows in (64, 1024, 4096) for kind in ("sync", "async") for threads in (1, 2)
)


@dataclass(frozen=True)
class Script:
    """A measuring script and its interpreter."""

    path: str
    """Path from the repository's root."""
    interpreter: Interpreter = "package"


@dataclass(frozen=True)
class Measure:
    """A measure."""

    group: str
    name: str
    """The script's name for it."""
    cores: int
    script: Script
    what: str
    unit: str = STEPS
    rounds: int | None = None
    """Greatest number of rounds, where a sample takes long."""
    slow: bool = False
    """True if it takes many seconds to build or to measure: left out of a quick run."""

    @property
    def key(self) -> str:
        """Name of the measure in the results, e.g. ``limit/double@2``."""
        return f"{self.group}/{self.name}@{self.cores}"


LIMIT: Final = Script("benchmarks/limit/measure.py")
DYNAMICS: Final = Script("benchmarks/package/dynamics.py")
ENVIRONMENTS: Final = Script("benchmarks/package/environments.py")
DRIVES: Final = Script("benchmarks/package/drives.py")
STARTUP: Final = Script("benchmarks/package/startup.py")
GYMNASIUM: Final = Script("benchmarks/peers/gymnasium_envs.py")
"""Gymnasium's environments in the package's own Gymnasium, so that both sides have the same wrappers."""
MUJOCO: Final = Script("benchmarks/peers/mujoco_pendulum.py", "peers")
ENVPOOL_SCRIPT: Final = Script("benchmarks/peers/envpool_pendulum.py", "peers")
GYMNAX: Final = Script("benchmarks/peers/gymnax_pendulum.py", "peers")
SOLVE_IVP: Final = Script("benchmarks/peers/solve_ivp.py", "peers")


def _speeds() -> Iterator[Measure]:
    for cores in (1, 2):
        yield Measure("limit", "double", cores, LIMIT, "C++, the same integrator without a sea, 4096 rows, float64")
        yield Measure("limit", "float", cores, LIMIT, "C++, the same integrator without a sea, 4096 rows, float32")
        yield Measure("dynamics", "calm", cores, DYNAMICS, "Engine.step, ship at rest, 4096 rows")
        yield Measure("dynamics", "sea", cores, DYNAMICS, "Engine.step, 32 wave components, 4096 rows")
        yield Measure(
            "env",
            "episodes-4096",
            cores,
            ENVIRONMENTS,
            "vector environment, whole episodes with autoreset, 4096 rows",
            rounds=3,
        )
    yield Measure("env", "episodes-64", 2, ENVIRONMENTS, "the same, 64 rows", rounds=3)
    yield Measure("env", "episodes-4096-default", 2, ENVIRONMENTS, "the same, 4096 rows, default inner step", rounds=3)
    yield Measure("env", "scalar", 1, ENVIRONMENTS, "env.step through gymnasium.make, resets included")
    yield Measure("env", "scalar-default", 1, ENVIRONMENTS, "the same, inner step as by default")
    yield Measure("dynamics", "one-row", 1, DYNAMICS, "Engine.step, 32 wave components, one row")
    for name, what in (
        ("massless", "light rope in air"),
        ("heavy", "rope of nine lumps in still water"),
        ("everything", "the same, and waves, current, seabed, limits of the winch, compensator, moving target"),
    ):
        yield Measure("dynamics", f"deep-{name}", 1, DYNAMICS, f"Engine.step, 1,000 m, 1,024 rows: {what}", slow=True)
    yield Measure("gymnasium", "pendulum", 1, GYMNASIUM, "Gymnasium Pendulum-v1 through gymnasium.make")
    yield Measure("gymnasium", "cartpole", 1, GYMNASIUM, "Gymnasium CartPole-v1 through gymnasium.make")
    yield Measure("gymnasium", "pendulum-vec-64", 1, GYMNASIUM, "Gymnasium Pendulum-v1, make_vec sync, 64 rows")
    yield Measure("gymnasium", "cartpole-vec-64", 1, GYMNASIUM, "Gymnasium CartPole-v1, make_vec sync, 64 rows")
    yield Measure("mujoco", "inverted-pendulum", 1, MUJOCO, "MuJoCo InvertedPendulum-v5 through gymnasium.make")
    yield Measure("mujoco", "rollout-1024", 2, MUJOCO, "mujoco.rollout of InvertedPendulum-v5's model, 1024 rows")
    for name in ENVPOOL:
        kind, rows, threads = name.split("-")
        batch = "" if kind == "sync" else f" in batches of {int(rows) // 2}"
        yield Measure(
            "envpool", name, 2, ENVPOOL_SCRIPT, f"EnvPool Pendulum-v1 {kind}, {rows} rows{batch}, threads: {threads}"
        )
    for cores in (1, 2):
        yield Measure("gymnax", "pendulum-4096", cores, GYMNAX, "gymnax Pendulum-v1 jitted on CPU, 4096 rows")
    yield Measure("gymnax", "pendulum-4096-scan", 2, GYMNAX, "the same, 200 steps in one call")
    yield Measure("solve_ivp", "episode", 1, SOLVE_IVP, "scipy.solve_ivp (RK45, rtol 1e-6), one row, 60 s")


def _others() -> Iterator[Measure]:
    yield Measure("limit", "deviation", 1, LIMIT, "load of the C++ limit against the package's, 60 s", "m", 1)
    yield Measure("drives", "omega1-alone", 1, DRIVES, "one evaluation of Ω1, paper's case, 36 s", "µs")
    yield Measure("drives", "omega1-filled", 1, DRIVES, "each of 64 evaluations of Ω1 together", "µs")
    yield Measure("drives", "omega1-error", 1, DRIVES, "relative error of Ω1 at the inner step of these", "", 1)
    yield Measure("drives", "paper-table", 2, DRIVES, "python -m train.drives --case paper", "s", 1, slow=True)
    memory = "a row of the vector environment, 65,536 rows, drawn seas, over an autoreset"
    yield Measure("env", "memory-peak", 2, ENVIRONMENTS, f"memory of {memory}, at its most", "KiB", 1, slow=True)
    for what, start in (("", "the environment"), ("-vector", "the vector environment")):
        yield Measure("startup", f"cold{what}", 1, STARTUP, f"make and reset {start}, nothing compiled", "s", 1, True)
        yield Measure("startup", f"warm{what}", 1, STARTUP, f"make and reset {start}, warm cache", "s", 3, True)
    yield Measure("startup", "import", 1, STARTUP, "import aframe_env, no torch in it", "s", 3, True)
    for name, what in (("engine", "Engine.step"), ("env", "vector environment within episodes")):
        for rows in COST_ROWS:
            yield Measure(
                "cost", f"{name}-{rows}", 2, ENVIRONMENTS, f"{what}, {rows:,} rows", rounds=3, slow=rows > 4096
            )


MEASURES: Final[dict[str, Measure]] = {measure.key: measure for measure in (*_speeds(), *_others())}
"""All measures by key, in the order of the run."""


def matching(only: tuple[str, ...], quick: bool = False) -> list[Measure]:
    """Measures whose key has one of the words in it, all if there are none; a quick run is spared the slow ones."""
    wanted = [m for m in MEASURES.values() if not only or any(word in m.key for word in only)]
    return [m for m in wanted if not (quick and m.slow)]

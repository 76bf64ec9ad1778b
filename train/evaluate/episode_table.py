"""Every episode of a comparison as one line of a Parquet file, with its scenario beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from aframe_env.scenario import Scenario
from aframe_env.scenario.sea import SeaMotion
from agents.policy import FloatArray, Knowledge
from train.evaluate.run import Comparison
from train.evaluate.statistics import reductions
from train.shared.run_folder import write_atomically

if TYPE_CHECKING:
    import pyarrow


@dataclass(frozen=True)
class Traits:
    """A scenario in figures; NaN for what a motion without a sea lacks."""

    hs: float
    """m."""
    tp: float
    """s."""
    heading: float
    """rad from the bow towards port: the direction that the waves travel towards."""
    gamma: float
    load_mass: float
    """kg."""
    rope_length: float
    """m."""
    rope_period: float
    """Natural period of the load bobbing on the rope, s."""
    sea_seed: int
    """-1 without a sea."""

    @classmethod
    def of(cls, scenario: Scenario) -> Traits:
        """Traits of a scenario."""
        sea = scenario.motion.sea if isinstance(scenario.motion, SeaMotion) else None
        nan = math.nan
        return cls(
            hs=sea.hs if sea else nan,
            tp=sea.tp if sea else nan,
            heading=sea.heading if sea else nan,
            gamma=sea.peak_enhancement if sea else nan,
            load_mass=scenario.load_mass,
            rope_length=scenario.rope_length,
            rope_period=2.0 * math.pi / scenario.rope_frequency,
            sea_seed=sea.seed if sea else -1,
        )


UNITS: Final = {
    "hs": "m",
    "tp": "s",
    "heading": "rad",
    "load_mass": "kg",
    "rope_length": "m",
    "rope_period": "s",
    "rms": "m",
    "omega1": "m² s",
    "omega2": "m",
    "peak_tension": "N",
    "drum_travel": "m",
    "peak_power": "W",
    "time_outside": "s",
}
"""Units of the columns that have one; also in the Parquet file, as each field's metadata."""


def table(comparison: Comparison) -> pyarrow.Table:
    """One line for each policy and scenario."""
    import pyarrow

    traits = [Traits.of(scenario) for scenario in comparison.scenarios]
    columns: dict[str, list[Any]] = {}
    for entry in comparison.entries:
        episodes = entry.episodes
        count = len(episodes.omega1)
        figures: dict[str, FloatArray] = {
            "reduction": reductions(entry, comparison.still),
            "rms": episodes.rms,
            "omega1": episodes.omega1,
            "omega2": episodes.omega2,
            "time_outside": episodes.time_outside,
            "peak_tension": episodes.peak_tension,
            "drum_travel": episodes.drum_travel,
            "peak_power": episodes.peak_power,
        }
        values: dict[str, list[Any]] = {
            "policy": [entry.policy] * count,
            "knows": [entry.knows.value] * count,
            "privileged": [entry.knows is Knowledge.FUTURE] * count,
            "model": [comparison.config.model] * count,
            "scenario": list(range(count)),
            **{field.name: [getattr(t, field.name) for t in traits[:count]] for field in fields(Traits)},
            **{name: np.asarray(figure).tolist() for name, figure in figures.items()},
            "slack_events": episodes.slack_events.tolist(),
            "parted": episodes.parted.tolist(),
        }
        for name, column in values.items():
            columns.setdefault(name, []).extend(column)
    arrays = {name: pyarrow.array(column) for name, column in columns.items()}
    schema = pyarrow.schema(
        [
            pyarrow.field(name, array.type, metadata={"unit": UNITS[name]} if name in UNITS else None)
            for name, array in arrays.items()
        ]
    )
    return pyarrow.table(arrays, schema=schema)


def write_episodes(path: Path, comparison: Comparison) -> None:
    """Write the table as Parquet, all or nothing."""
    from pyarrow import parquet

    write_atomically(path, lambda temporary: parquet.write_table(table(comparison), temporary, compression="zstd"))

"""Storm: a winch that is too weak for the sea, so that who looks ahead wins."""

from __future__ import annotations

from typing import Final

from aframe_env.scenario import ScenarioDistribution
from aframe_env.suite.definition import Seeds, Task

TASK: Final = Task(
    name="Storm",
    version=0,
    isolates="anticipation: the winch saturates",
    distribution=ScenarioDistribution(
        hs=(3.0, 5.0),
        tp=(7.0, 12.0),
        max_rope_speed=(1.5, 2.5),
        max_rope_acceleration=(1.0, 2.0),
    ),
    seeds=Seeds(train=221_000_001, validation=221_000_002, test=221_000_003),
    left_out={"validation": frozenset({5})},
    digests={
        "train": "2ec56a9a6ad817531709816ff4ccccd8fc3645cc0688fdc00054b825b3159140",
        "validation": "b05e3a8cf208686754d276fc41270e1cf0d7d98099fa87958747d8b50f5eadab",
        "test": "385108d008636f7213d0bc600388df9968c2a7759aa925b0ca7e7e7da8b94030",
    },
)

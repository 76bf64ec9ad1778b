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
        "train": "905de85def9ab46fcff1082757cd793dbfbcbdec04ed44047715bfc76e69d841",
        "validation": "bed43384e6a7980d440e421831325bf1a61c984be0b22d0320eddfebed2cd6c9",
        "test": "969b9d1607f1edca5c59815749126c7cc8b3f80f6fad750dde0e5c3459322d24",
    },
)

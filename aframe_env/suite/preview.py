"""Preview: the seas and winches of Storm, and a wave radar that foretells the pulley's heave, the worse the later."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from aframe_env.scenario import Preview, Sensors
from aframe_env.suite import storm
from aframe_env.suite.definition import Seeds, Task

TASK: Final = Task(
    name="Preview",
    version=0,
    isolates="prediction: a noisy preview of 15 s, the winch saturating",
    distribution=replace(storm.TASK.distribution, sensors=Sensors(preview=Preview())),
    seeds=Seeds(train=225_000_001, validation=225_000_002, test=225_000_003),
    digests={
        "train": "0dad97594e38ecfa977c480de4708e80dc42da32ce4503d690adc3ea0f141f23",
        "validation": "ec3382893d1261b52675499e9a305a7df4245a980376978098edc3b60053f397",
        "test": "9423d74aa9da81d9400c87c8d2020974753c356d3c5cade043ce4df0bcd00e2e",
    },
)

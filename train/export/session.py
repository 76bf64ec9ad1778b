"""An exported controller in ONNX Runtime, a session for all lifts and a state for each."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.error import DependencyNotInstalled

FloatArray = npt.NDArray[np.float64]


class Session:
    """A model on one core."""

    def __init__(self, path: Path) -> None:
        try:
            import onnxruntime
        except ImportError:
            raise DependencyNotInstalled('onnxruntime is not installed: pip install "aframe-heave[onnx]"') from None
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session: Any = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        sizes = {each.name: each.shape[0] for each in self._session.get_inputs()}
        self.state_size: int = sizes["state"]
        self.metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        self.seconds: list[float] = []
        """Time of every step."""

    def step(self, readings: FloatArray, told: FloatArray, state: FloatArray) -> tuple[float, bool, FloatArray]:
        """Drum speed [rad/s], fault, and the state for the next step; a state of zeros begins a lift."""
        start = perf_counter()
        drum_speed, fault, after = self._session.run(None, {"readings": readings, "told": told, "state": state})
        self.seconds.append(perf_counter() - start)
        return float(drum_speed[0]), bool(fault[0]), after

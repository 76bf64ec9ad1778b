"""Libraries that are tried, each with its script and environment."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
SCRIPTS: Final = ROOT / "compat" / "scripts"
STAGES: Final = ("made", "stepped", "trained", "saved")
"""What a script says when it has done it, a line each; saved: and loaded again, with the same outcome."""


@dataclass(frozen=True, kw_only=True)
class Library:
    """A library, and how it is tried."""

    name: str
    distribution: str
    """Whose version is told."""
    script: Path
    environment: str = "learners"
    """``compat/NAME.txt`` says what is in it, ``.venv-compat/NAME`` is where it lies."""
    beside: tuple[Path, ...] = ()
    """Files that the script needs beside it."""
    stages: tuple[str, ...] = STAGES
    remark: str = ""
    """What a user should know, for the table."""


LIBRARIES: Final = (
    Library(
        name="Stable-Baselines3",
        distribution="stable-baselines3",
        script=SCRIPTS / "learn_sb3.py",
        remark="workers need the id with its module, `aframe_env:AFrameHeave-v0`",
    ),
    Library(name="sb3-contrib", distribution="sb3-contrib", script=SCRIPTS / "learn_sb3_contrib.py"),
    Library(name="SBX", distribution="sbx-rl", script=SCRIPTS / "learn_sbx.py"),
    Library(
        name="rl-zoo3",
        distribution="rl-zoo3",
        script=SCRIPTS / "learn_rl_zoo3.py",
        beside=(ROOT / "examples" / "rl_zoo3" / "ppo.yml",),
        remark="`--gym-packages aframe_env`; `rl_zoo3.enjoy` imports requests, which rl-zoo3 does not bring",
    ),
    Library(
        name="CleanRL's style",
        distribution="gymnasium",
        script=SCRIPTS / "loop_cleanrl.py",
        beside=(ROOT / "examples" / "learn_cleanrl.py",),
        remark="the version is Gymnasium's: CleanRL is files to copy, not a library",
    ),
    Library(
        name="Minari",
        distribution="minari",
        script=SCRIPTS / "record_minari.py",
        stages=("made", "stepped", "saved"),
        remark="`pip install minari[hdf5]`; records data sets, does not train",
    ),
    Library(
        name="TorchRL",
        distribution="torchrl",
        script=SCRIPTS / "learn_torchrl.py",
        remark="`GymEnv(...).auto_register_info_dict()` has the information in its tensors",
    ),
    Library(
        name="skrl",
        distribution="skrl",
        script=SCRIPTS / "learn_skrl.py",
        remark="learns from Gymnasium's reset step as if it were one: make rows with `autoreset_mode` SAME_STEP",
    ),
    Library(name="Tianshou", distribution="tianshou", script=SCRIPTS / "learn_tianshou.py"),
    Library(
        name="RLlib",
        distribution="ray",
        script=SCRIPTS / "learn_rllib.py",
        environment="rllib",
        remark="pins Gymnasium at 1.2.2: an environment of its own; the id with its module, as for all workers",
    ),
)

"""``aframe COMMAND``: the commands of ``train`` by short names, each imported when it is called."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import Final

from aframe_env import __version__
from aframe_env.neighbours import PACKAGES, in_the_way

COMMANDS: Final[Mapping[str, str]] = {
    "ppo": "train a PPO agent and compare it",
    "sac": "train a SAC agent and compare it",
    "apg": "train a recurrent agent by the gradient of its score",
    "gpu-ppo": "train a PPO agent of rsl_rl on a GPU",
    "evaluate": "compare policies on held-out scenarios, and write the report",
    "benchmark": "score policies on the tasks of the suite",
    "scenes": "draw one telling scenario of each task",
    "drives": "optimise drum drives for one scenario, as in the paper",
    "drive-map": "build the map of basic drives",
    "optimisers": "compare Gauss-Newton with Nelder-Mead",
    "sensitivity": "study policies that were told wrongly",
    "deep-water": "study what heavy ropes in deep water do to control",
    "tune": "search for a learner's hyper-parameters",
    "tune-control": "tune the gains of the control laws",
    "verify": "check the full model, or run a case of your own on it",
    "vessel": "compute a vessel's response with Capytaine",
    "demo": "watch a lift in the browser, live",
    "render": "draw a picture of the environment",
    "video": "write an episode as MP4 or GIF",
    "dataset": "make Minari data sets for offline learning",
    "export": "write an agent as ONNX, for machines without Python",
}
"""What each command does. ``drive-map`` is ``main()`` of ``train/drive_map.py`` or ``train/drive_map/__main__.py``."""


def usage() -> str:
    """Help on all commands."""
    width = max(map(len, COMMANDS))
    lines = [f"  {name:<{width}}  {what}" for name, what in COMMANDS.items()]
    return "\n".join(
        [
            "usage: aframe [-h] [--version] COMMAND ...",
            "",
            "Active heave compensation under an offshore A-frame crane.",
            "",
            "commands:",
            *lines,
            "",
            "aframe COMMAND --help lists a command's options.",
        ]
    )


def main() -> int:
    """Run a command; return its exit status."""
    name, *arguments = sys.argv[1:] or [""]
    if name in ("-h", "--help"):
        print(usage())
        return 0
    if name == "--version":
        print(f"aframe-heave {__version__}")
        return 0
    if name not in COMMANDS:
        return _refuse(f"command = {name!r}: must be one of {', '.join(COMMANDS)}; aframe --help says what they do")
    for package in PACKAGES:
        sentence = in_the_way(package)
        if sentence is not None:
            return _refuse(sentence)
    # The command's usage line and its record of the command line begin with this.
    sys.argv = [f"aframe {name}", *arguments]
    status: int = import_module(_module(name)).main()
    return status


def _module(name: str) -> str:
    module = f"train.{name.replace('-', '_')}"
    spec = find_spec(module)
    return module if spec is None or spec.submodule_search_locations is None else f"{module}.__main__"


def _refuse(sentence: str) -> int:
    print(f"error: {sentence}", file=sys.stderr)
    return 2

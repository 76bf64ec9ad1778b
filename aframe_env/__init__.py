"""Active heave compensation of a load under an offshore A-frame crane, as a Gymnasium environment.

Importing this package registers ``AFrameHeave-v0`` and the tasks of the suite, ``AFrameHeave-Storm-v0`` and so on. What
it exports is listed in ``__init__.pyi`` and loaded when it is first used, so that the import itself is quick.
"""

from __future__ import annotations

import warnings

import gymnasium
import lazy_loader

from aframe_env.neighbours import in_the_way, overwritten

__version__ = "0.1.0"
ENV_ID = "AFrameHeave-v0"

_TASKS = "Storm", "Unknown", "DeepRope", "Preview", "MRU", "Splash", "Landing"
_SUITE = {f"AFrameHeave-{name}-v0": {"task": name} for name in _TASKS}
"""Ids of the tasks in ``aframe_env.suite``, which an import has no time to ask."""

for _id, _arguments in {ENV_ID: {}, **_SUITE}.items():
    if _id not in gymnasium.registry:
        # The environment truncates by itself, after `episode_duration`; a TimeLimit wrapper would cut a longer one.
        gymnasium.register(
            id=_id,
            entry_point="aframe_env.env:AFrameHeaveEnv",
            vector_entry_point="aframe_env.vector_env:AFrameHeaveVectorEnv",
            kwargs=_arguments,
        )

# A folder of the user's may well be called so, and this package does without it. One that is damaged is worth a word.
if overwritten("agents"):
    warnings.warn(f"{in_the_way('agents')}", stacklevel=2)

__getattr__, _, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["ENV_ID"]


def __dir__() -> list[str]:
    return __all__

"""Learners by name.

A new one is a module with a ``SPEC``, a line here, and a door like ``train/ppo.py``.
"""

from __future__ import annotations

from importlib import import_module
from typing import Final

from gymnasium.error import DependencyNotInstalled

from train.learn.learner import LearnerSpec
from train.learn.options import LearningOptions

LEARNERS: Final = {
    "ppo": "train.learn.ppo",
    "ppo-predictive": "train.learn.ppo_predictive",
    "ppo-recurrent": "train.learn.ppo_recurrent",
    "ppo-rsl": "train.learn.ppo_rsl",
    "sac": "train.learn.sac",
    "sac-recurrent": "train.learn.sac_recurrent",
}
"""Module of each learner. One is imported when it is asked for, since some need an extra."""


def find_learner(name: str) -> LearnerSpec:
    """Return a learner by its name."""
    try:
        spec: LearnerSpec = import_module(LEARNERS[name]).SPEC
    except ModuleNotFoundError as error:
        raise DependencyNotInstalled(f'{error.name} is not installed: pip install "aframe-heave[cuda]"') from error
    return spec


def learner_of(options: LearningOptions) -> LearnerSpec:
    """Return the learner whose options these are: a module has both."""
    spec: LearnerSpec = import_module(type(options).__module__).SPEC
    return spec

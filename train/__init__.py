"""Commands: aframe ppo or python -m train.ppo, aframe drives, ..."""

from aframe_env import __version__
from aframe_env.neighbours import in_the_way

__all__ = ["__version__"]

_sentence = in_the_way("agents")
if _sentence is not None:
    # By this name python -m takes it for a train that cannot be had, and says the sentence without a traceback.
    raise ImportError(_sentence, name=__name__)

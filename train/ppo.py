"""Train a PPO agent to hold the load still, then compare it with the paper's drives: ``python -m train.ppo``."""

from __future__ import annotations

import sys

from train.learn.run import main

if __name__ == "__main__":
    sys.exit(main("ppo"))

"""Search for a learner's hyper-parameters: ``python -m train.tune --algorithm ppo --out runs/tune-ppo``."""

from __future__ import annotations

import sys

from train.learn.tune import main

if __name__ == "__main__":
    sys.exit(main())

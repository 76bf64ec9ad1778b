"""Train an agent by analytic policy gradient on a linear twin of the task: ``python -m train.apg``."""

from __future__ import annotations

import sys

from train.learn.run import main

if __name__ == "__main__":
    sys.exit(main("apg"))

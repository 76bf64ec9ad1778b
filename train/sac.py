"""Train a SAC agent to hold the load still, then compare it with the paper's drives: ``python -m train.sac``."""

from __future__ import annotations

import sys

from train.learn import run


def main() -> int:
    """Run the command."""
    return run.main("sac")


if __name__ == "__main__":
    sys.exit(main())

"""Train a PPO agent of rsl_rl on rows of tensors: ``python -m train.gpu_ppo``.

``--device cpu`` tries it where there is no GPU.
"""

from __future__ import annotations

import sys

from train.learn import run


def main() -> int:
    """Run the command."""
    return run.main("ppo-rsl")


if __name__ == "__main__":
    sys.exit(main())

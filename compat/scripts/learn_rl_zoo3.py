"""rl-zoo3: its command line, with the settings of ppo.yml, which lies beside this script."""

import subprocess
import sys
from pathlib import Path

COMMON = ("--algo", "ppo", "--env", "AFrameHeave-v0", "--gym-packages", "aframe_env", "-f", "logs", "--seed", "0")


def zoo(command: str, *options: str) -> None:
    """Run one of its commands."""
    subprocess.run([sys.executable, "-m", f"rl_zoo3.{command}", *COMMON, *options], check=True)


def main() -> None:
    """Make, step, train, save and load."""
    zoo("train", "-c", "ppo.yml", "-n", "8192", "--device", "cpu", "--eval-freq", "-1")
    print("made", "stepped", "trained", sep="\n")
    assert Path("logs/ppo/AFrameHeave-v0_1/AFrameHeave-v0.zip").is_file()
    zoo("enjoy", "-n", "700", "--no-render", "--device", "cpu")
    print("saved")


if __name__ == "__main__":
    main()

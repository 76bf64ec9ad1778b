"""Install the peers of a requirements file one by one, ``python install.py peers.txt``, into this interpreter's
environment. One that cannot be installed leaves the others alone: why stands in failures.json, for the report.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path


def main() -> None:
    requirements = Path(sys.argv[1])
    failures = {}
    for line in requirements.read_text(encoding="utf-8").splitlines():
        if not line or line.startswith("#"):
            continue
        pip = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", "-q", "-c", str(requirements)]
        done = subprocess.run([*pip, line], capture_output=True, text=True)
        if done.returncode:
            errors = done.stderr.strip().splitlines() or [f"pip ended with status {done.returncode}"]
            failures[line] = next((error for error in errors if error.startswith("ERROR")), errors[-1])
            print(f"{line}: {failures[line]}", file=sys.stderr)
    (Path(sys.prefix) / "failures.json").write_text(json.dumps(failures, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()

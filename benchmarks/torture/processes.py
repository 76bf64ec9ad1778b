"""Commands in processes of their own that need not import anything first, so that many can be killed."""

from __future__ import annotations

import os
import runpy
import sys
import threading
from multiprocessing import get_context
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Final

_CONTEXT: Final = get_context("forkserver")
# What is imported there has computed nothing yet: a fork of it is as good as a new process.
_CONTEXT.set_forkserver_preload(["train.learn.run", "train.learn.ppo", "train.learn.sac"])


def start(said: Path, module: str, *arguments: object) -> ForkServerProcess:
    """Start ``python -m module arguments``; what it prints goes to the end of the file ``said``."""
    process = _CONTEXT.Process(target=_run, args=(said, module, tuple(map(str, arguments))))
    process.start()
    return process


def _run(said: Path, module: str, arguments: tuple[str, ...]) -> None:
    handle = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(handle, stream.fileno())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)

"""Commands in processes of their own that need not import anything first, so that many can be killed."""

from __future__ import annotations

import os
import runpy
import sys
import threading
from collections.abc import Mapping
from multiprocessing import get_context
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Final

_CONTEXT: Final = get_context("forkserver")
# What is imported there has computed nothing yet: a fork of it is as good as a new process.
_CONTEXT.set_forkserver_preload(["train.learn.run", "train.learn.ppo", "train.learn.sac"])


def start(
    said: Path,
    module: str,
    *arguments: object,
    environment: Mapping[str, str] | None = None,
    largest_file: int | None = None,
) -> ForkServerProcess:
    """Start ``python -m module arguments``; what it prints goes to the end of the file ``said``.

    ``environment``: variables besides. ``largest_file``: most bytes of a file that it may write.
    """
    command = (module, *map(str, arguments))
    process = _CONTEXT.Process(target=_run, args=(said, command, dict(environment or {}), largest_file))
    process.start()
    return process


def _run(said: Path, command: tuple[str, ...], environment: dict[str, str], largest_file: int | None) -> None:
    import resource  # not on Windows

    handle = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(handle, stream.fileno())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.environ.update(environment)
    if largest_file is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, resource.RLIM_INFINITY))
    sys.argv = list(command)
    runpy.run_module(command[0], run_name="__main__", alter_sys=True)


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)

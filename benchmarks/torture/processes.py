"""Commands in processes of their own that need not import anything first, so that many can be killed."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
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
    folder: Path | None = None,
) -> ForkServerProcess:
    """Start ``python -m module arguments``; what it prints goes to the end of the file ``said``.

    ``environment``: variables besides. ``largest_file``: most bytes of a file that it may write. ``folder``: where it
    starts, by default here.
    """
    command = (module, *map(str, arguments))
    process = _CONTEXT.Process(target=_run, args=(said, command, dict(environment or {}), largest_file, folder))
    process.start()
    return process


def _run(
    said: Path,
    command: tuple[str, ...],
    environment: dict[str, str],
    largest_file: int | None,
    folder: Path | None,
) -> None:
    import resource  # not on Windows

    handle = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(handle, stream.fileno())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.environ.update(environment)
    if largest_file is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, resource.RLIM_INFINITY))
    if folder is not None:
        os.chdir(folder)
    sys.argv = list(command)
    # Under its own name: what a worker returns would else be of ``__mp_main__``, which is another module here.
    spec = find_spec(module := command[0])
    package = spec is not None and spec.submodule_search_locations is not None
    sys.exit(import_module(f"{module}.__main__" if package else module).main())


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)

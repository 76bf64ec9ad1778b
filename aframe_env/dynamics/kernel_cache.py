"""The cache of compiled kernels on disk, in which every file ends with a digest of what it holds.

numba trusts its files: of a damaged one it runs the machine code, or fails at every start until somebody deletes it.
"""

from __future__ import annotations

import hashlib
import io
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, Final

from numba.core.caching import FunctionCache, IndexDataCacheFile

_LOGGER = logging.getLogger("aframe_env")
_DIGEST: Final = hashlib.sha256().digest_size
"""bytes."""


class _CheckedFiles(IndexDataCacheFile):  # type: ignore[misc]
    """Index and data of a kernel. What is damaged counts as missing, and is written anew by the next save."""

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[io.BytesIO]:
        content = io.BytesIO()
        yield content
        with super()._open_for_write(filepath) as file:
            file.write(content.getvalue() + hashlib.sha256(content.getvalue()).digest())

    # The digest behind the pickles does not disturb pickle.loads.
    def _load_index(self) -> dict[Any, str]:
        return super()._load_index() if _is_whole(Path(self._index_path)) else {}

    def _load_data(self, name: str) -> Any:
        return super()._load_data(name) if _is_whole(Path(self._data_path(name))) else None


class KernelCache(FunctionCache):  # type: ignore[misc]
    """numba's cache of a function, with checked files, where a folder can be written to.

    Raises ``RuntimeError`` where none can.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _CheckedFiles(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep a compiled function, or say why it cannot be kept."""
        try:
            super().save_overload(signature, compiled)
        except OSError as error:
            _warn_once(f"aframe_env: compiled code cannot be kept, so that the next start compiles it again: {error}")


def _is_whole(path: Path) -> bool:
    """Whether a file is there and as it was written; a word where it is not as it was written."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return False
    except OSError as error:
        _warn_once(f"aframe_env: compiled code in {path.parent} cannot be read and is compiled anew: {error}")
        return False
    if hashlib.sha256(content[:-_DIGEST]).digest() == content[-_DIGEST:]:
        return True
    _warn_once(f"aframe_env: compiled code in {path.parent} is damaged and is compiled anew")
    return False


@cache
def _warn_once(message: str) -> None:
    _LOGGER.warning(message)

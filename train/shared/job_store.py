"""Finished jobs on disk: SQLite, one row for each, keyed by a hash of its configuration and sealed by a digest."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import inspect
import json
import sqlite3
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Final, Generic, TypeVar, get_origin

import numpy as np
import numpy.typing as npt
from cattrs import Converter

from aframe_env.dynamics.compiling import source_digest
from aframe_env.serialization import strict_converter, structure
from aframe_env.validation import InvalidValue

Result = TypeVar("Result")

JOBS: Final = "jobs.sqlite"
"""Name of a store in a run folder."""
_COLUMNS = "results (key TEXT PRIMARY KEY, result TEXT NOT NULL, digest TEXT NOT NULL) WITHOUT ROWID"


class NotStored(InvalidValue):
    """A result with NaN or infinity, which is kept nowhere."""


def version_of(*modules: ModuleType) -> str:
    """Digest of the physics' and of these modules' sources: whatever changes, older results no longer count.

    A package stands for all of its modules.
    """
    digest = hashlib.sha256(source_digest().encode())
    for module in modules:
        for folder in getattr(module, "__path__", ()):
            for path in sorted(Path(folder).rglob("*.py")):
                digest.update(path.read_bytes())
        digest.update(inspect.getsource(module).encode())
    return digest.hexdigest()


@dataclass
class JobStore(Generic[Result]):
    """Results of type ``kind`` (a dataclass of plain data and arrays, or plain data) in the SQLite file ``path``.

    They are JSON; nothing of it is executable. A written result survives the death of the process and of the machine.
    ``version`` names what computes the results: it is part of every key. A row that does not match its digest is named
    on standard error and dropped when the store is opened, so that it is computed anew. Stores of several kinds may
    share a file.
    """

    path: Path
    kind: type[Result]
    version: str
    _database: sqlite3.Connection = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._converter = _converter()
        with self._errors("not a results store, or damaged: delete it, and what it held is computed anew: "):
            self._database = sqlite3.connect(self.path, timeout=60.0, isolation_level=None)
            # Damaged text is told by its digest, not by its encoding.
            self._database.text_factory = bytes
            # No write-ahead log: of one that is damaged the rest is silently left out, and it needs a local disk.
            self._database.execute("PRAGMA journal_mode = DELETE")
            self._database.execute("PRAGMA synchronous = EXTRA")
            self._database.execute(f"CREATE TABLE IF NOT EXISTS {_COLUMNS}")
            tables = self._database.execute("SELECT sql FROM sqlite_master").fetchall()
            if tables != [(f"CREATE TABLE {_COLUMNS}".encode(),)]:
                raise sqlite3.DatabaseError("it holds other tables")
            [(said,), *_] = self._database.execute("PRAGMA quick_check(1)").fetchall()
            if said != b"ok":
                raise sqlite3.DatabaseError(" ".join(said.decode(errors="replace").split()))
            self._drop_damaged()

    def _drop_damaged(self) -> None:
        rows = self._database.execute("SELECT CAST(key AS BLOB), result, digest FROM results")
        damaged = [key for key, result, digest in rows if not _matches(key, result, digest)]
        for key in damaged:
            self._database.execute("DELETE FROM results WHERE CAST(key AS BLOB) = ?", (key,))
            self._name(key, "does not match its digest")

    def _name(self, key: bytes, what: str) -> None:
        job = key.decode(errors="replace")[:12]
        print(f"warning: store = {str(self.path)!r}: job {job!r} {what}: it is computed anew", file=sys.stderr)

    @contextlib.contextmanager
    def _errors(self, words: str = "") -> Iterator[None]:
        try:
            yield
        # Where the words of SQLite quote what is damaged, they need not be UTF-8.
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise InvalidValue(f"store = {str(self.path)!r}: {words}{error}") from error

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def __enter__(self) -> JobStore[Result]:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def key(self, configuration: Any) -> str:
        """Hash of a configuration (dataclass or plain data), of the results' version and of their type."""
        data = self._converter.unstructure(configuration)
        text = json.dumps([self.version, self.kind.__qualname__, data], sort_keys=True, allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def read(self, keys: Sequence[str]) -> dict[str, Result]:
        """Read the stored results of these keys; missing ones are left out, and those that are no result, named."""
        found: dict[str, Result] = {}
        for key in keys:
            with self._errors():
                row = self._database.execute("SELECT result FROM results WHERE key = ?", (key,)).fetchone()
            if row is not None:
                try:
                    found[key] = structure(self._converter, json.loads(row[0]), self.kind, "result")
                except (ValueError, TypeError, AttributeError) as error:
                    self._name(key.encode(), f"holds no {self.kind.__name__} ({error})")
        return found

    def write(self, key: str, result: Result) -> None:
        """Keep a result; it is on disk when this returns. Raises ``NotStored`` for one with NaN or infinity."""
        try:
            text = json.dumps(self._converter.unstructure(result), allow_nan=False)
        except ValueError as error:
            raise NotStored(f"the result of job {key[:12]!r} has NaN or infinity in it: it is not stored") from error
        with self._errors():
            self._database.execute(
                "INSERT OR REPLACE INTO results VALUES (?, ?, ?)", (key, text, _digest(key.encode(), text.encode()))
            )

    def get(self, configuration: Any, compute: Callable[[], Result]) -> Result:
        """Return the stored result of a configuration, or what ``compute`` returns, which is then stored."""
        key = self.key(configuration)
        found = self.read([key])
        if key not in found:
            self.write(key, result := compute())
            return result
        return found[key]


def _digest(key: bytes, result: bytes) -> str:
    return hashlib.sha256(key + b" " + result).hexdigest()


def _matches(key: bytes, result: Any, digest: Any) -> bool:
    return isinstance(result, bytes) and digest == _digest(key, result).encode()


def _converter() -> Converter:
    converter = strict_converter()
    converter.register_unstructure_hook_func(_is_array, _plain_array)
    converter.register_structure_hook_func(_is_array, _array)
    return converter


def _is_array(kind: Any) -> bool:
    return (get_origin(kind) or kind) is np.ndarray


def _plain_array(array: npt.NDArray[Any]) -> dict[str, Any]:
    if array.dtype.kind not in "biufc" or not np.isfinite(array).all():
        raise ValueError("must be an array of finite numbers")
    data = base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
    return {"dtype": array.dtype.str, "shape": list(array.shape), "base64": data}


def _array(data: Any, _: Any) -> npt.NDArray[Any]:
    flat = np.frombuffer(base64.b64decode(data["base64"]), dtype=data["dtype"])
    return flat.reshape(data["shape"]).copy()

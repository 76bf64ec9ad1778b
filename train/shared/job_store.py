"""Finished jobs on disk: SQLite, one row for each, keyed by a hash of its configuration."""

from __future__ import annotations

import hashlib
import inspect
import json
import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Generic, TypeVar

from aframe_env.dynamics.compiling import source_digest
from aframe_env.serialization import strict_converter, structure
from aframe_env.validation import InvalidValue

Result = TypeVar("Result")

_TABLE = "CREATE TABLE IF NOT EXISTS results (key TEXT PRIMARY KEY, result TEXT NOT NULL) WITHOUT ROWID"


def version_of(*modules: ModuleType) -> str:
    """Digest of the physics' and of these modules' sources: whatever changes, older results no longer count."""
    digest = hashlib.sha256(source_digest().encode())
    for module in modules:
        digest.update(inspect.getsource(module).encode())
    return digest.hexdigest()


@dataclass
class JobStore(Generic[Result]):
    """Results of type ``kind`` (a dataclass of plain data, or plain data) in the SQLite file ``path``, as JSON.

    Nothing of it is executable. A written result survives the death of the process and of the machine (write-ahead
    log, synchronous FULL). ``version`` names what computes the results: it is part of every key.
    """

    path: Path
    kind: type[Result]
    version: str
    _database: sqlite3.Connection = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._converter = strict_converter()
        try:
            self._database = sqlite3.connect(self.path, timeout=60.0, isolation_level=None)
            self._database.execute("PRAGMA journal_mode = WAL")
            self._database.execute("PRAGMA synchronous = FULL")
            self._database.execute(_TABLE)
        except sqlite3.DatabaseError as error:
            raise InvalidValue(f"store = {str(self.path)!r}: not a results store: {error}") from error

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
        """Read the stored results of these keys; missing ones are left out."""
        found: dict[str, Result] = {}
        for key in keys:
            row = self._database.execute("SELECT result FROM results WHERE key = ?", (key,)).fetchone()
            if row is not None:
                found[key] = structure(self._converter, json.loads(row[0]), self.kind, str(self.path))
        return found

    def write(self, key: str, result: Result) -> None:
        """Keep a result; it is on disk when this returns."""
        text = json.dumps(self._converter.unstructure(result))
        self._database.execute("INSERT OR REPLACE INTO results VALUES (?, ?)", (key, text))

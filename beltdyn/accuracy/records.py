"""A file of JSON lines that keeps measurements, so that they are not repeated."""

from __future__ import annotations

import hashlib
import json
import os
import threading
from collections.abc import Collection
from pathlib import Path
from typing import Any

__all__ = ["Records", "key_of"]


def key_of(*contents: Any) -> str:
    """Return a key that changes with any of the contents, which JSON can hold."""
    text = json.dumps(contents, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


class Records:
    """Records by key; each is a line, written at once. Safe in several threads.

    A line that is not complete, because a run was killed while it was written, is ignored.

    Args:
        path: The file, made if it is not there; None: kept in memory alone.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is there, and none of it is a record: a file of something else, which is not
            to be written to.
    """

    def __init__(self, path: str | os.PathLike[str] | None) -> None:
        self._path = None if path is None else Path(path)
        self._lock = threading.Lock()
        self._known: dict[str, dict[str, Any]] = {}
        self._torn = False
        if self._path is not None and self._path.exists():
            text = self._path.read_text("utf-8", errors="replace")
            self._torn = bool(text) and not text.endswith("\n")
            for line in text.splitlines():
                try:
                    record = json.loads(line)
                    self._known[record.pop("key")] = record
                except (ValueError, KeyError, TypeError, AttributeError):
                    continue
            if text.strip() and not self._known and not text.startswith('{"key": '):
                raise ValueError(f"store {self._path}: the file holds something else than records")

    def get(self, key: str, fields: Collection[str]) -> dict[str, Any] | None:
        """Return the record of a key; None if there is none, or one that lacks a field."""
        record = self._known.get(key)
        return record if record is not None and set(record) == set(fields) else None

    def add(self, key: str, record: dict[str, Any]) -> None:
        """Keep a record.

        Raises:
            OSError: The file cannot be written.
        """
        with self._lock:
            self._known[key] = record
            if self._path is None:
                return
            line = json.dumps({"key": key, **record}) + "\n"
            with self._path.open("a", encoding="utf-8") as file:
                file.write("\n" + line if self._torn else line)
            self._torn = False

"""The store of a sweep: a folder of netCDF files, one for each part, written as the sweep goes.

A part is complete or not there: it is written beside its place and then renamed. Runs are found by
the key of their content (:mod:`beltdyn.sweeping.content`), whatever sweep has put them there, also
while others write to the same folder. A part holds runs of one layout::

    key (run)               of their content
    status (run)            how they ended
    texts (run)             messages, warnings and measured texts, as JSON
    numbers (run, number)   measured numbers in a row
    final (run, entry)      the states at their ends, if other runs start from these

Its attribute ``layout`` tells, as JSON, which quantities the numbers and texts are of; ``checksum``
is that of all the rest.
"""

from __future__ import annotations

import hashlib
import json
import secrets
import tempfile
import time
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..base import files
from ..base.optional import optional_module
from ..base.stopping import without_ctrl_c
from ..result.exported import write_netcdf
from .outcomes import NOTHING, Axis, Layout, Outcome, Quantity

__all__ = ["Store"]

_FORMAT = 3
_NAME = "part-*.nc"
#: Between two parts: at least so long [s], this share of the time since the sweep began, at most.
#: A kill then costs little of what was computed, and long sweeps have some hundred parts.
_LEAST, _SHARE, _MOST = 2.0, 0.01, 300.0
#: Runs that did not end by themselves are not kept.
_KEPT = ("finished", "failed")
#: Raised by what reads netCDF, and here, of files that are not what was written.
_DAMAGED = (
    *(OSError, RuntimeError, ValueError, KeyError, TypeError, IndexError, AttributeError),
    *(OverflowError, MemoryError),
)
_TEXTS = ("status", "message", "warnings", "kernels")


class Store:
    """Outcomes of runs by key.

    Args:
        path: The folder, made if it is not there.

    Raises:
        OSError: It cannot be made or read.
        ValueError: It holds something else.
    """

    def __init__(self, path: Any) -> None:
        self._xarray = optional_module("xarray", "beltdyn.sweep", "sweep")
        optional_module("netCDF4", "a store", "sweep")
        self._path = Path(path)
        if self._path.is_file():
            raise ValueError(f"store {self._path}: it is a file; a store is a folder of its own")
        self._path.mkdir(parents=True, exist_ok=True)
        others = [
            one.name
            for one in self._path.iterdir()
            if not one.match(_NAME) and not one.name.startswith(".")  # parts being written
        ]
        if others:
            raise ValueError(
                f"store {self._path}: the folder holds something else, {others[0]}; a store is a "
                "folder of its own"
            )
        files.check_writable(self._path / "part")
        # The first file of a process makes xarray import what takes seconds: not in the middle of
        # a sweep, and not while Ctrl-C waits for it.
        with without_ctrl_c(), tempfile.TemporaryDirectory() as folder:
            self._xarray.Dataset().to_netcdf(Path(folder) / "empty.nc", engine="netcdf4")
        self._waiting: list[tuple[str, Outcome]] = []
        self._begun = self._written = time.monotonic()

    def find(self, keys: Collection[str]) -> dict[str, Outcome]:
        """Return the outcomes that are there.

        Raises:
            ValueError: A part is damaged.
        """
        wanted = set(keys)
        found: dict[str, Outcome] = {}
        for part in sorted(self._path.glob(_NAME)):
            try:
                found.update(self._read(part, wanted))
            except _DAMAGED as error:
                raise ValueError(
                    f"store {self._path}: {part.name} cannot be read ({error}): remove it, and its "
                    "runs are done again"
                ) from error
        return found

    def add(self, key: str, outcome: Outcome) -> None:
        """Keep an outcome; :meth:`tend` writes it soon."""
        if outcome.status in _KEPT and outcome.reproducible:
            self._waiting.append((key, outcome))

    def tend(self) -> None:
        """Write waiting outcomes, if the last part is some time ago.

        Raises:
            OSError: A part cannot be written.
        """
        now = time.monotonic()
        if now - self._written >= min(max(_LEAST, _SHARE * (now - self._begun)), _MOST):
            self.flush()

    def flush(self) -> None:
        """Write waiting outcomes.

        Raises:
            OSError: A part cannot be written.
        """
        by_layout: dict[tuple[Layout, int], list[tuple[str, Outcome]]] = {}
        for key, outcome in self._waiting:
            group = (outcome.layout, outcome.final.size)
            by_layout.setdefault(group, []).append((key, outcome))
        for (layout, _), rows in by_layout.items():
            part = self._path / f"part-{time.time_ns():020d}-{secrets.token_hex(4)}.nc"
            try:
                write_netcdf(self._dataset(layout, rows), part)
            except OSError as error:
                what = f"{error.strerror}; make room there: what was written before is kept"
                raise OSError(error.errno, what, error.filename) from error
        self._waiting.clear()
        self._written = time.monotonic()

    def _dataset(self, layout: Layout, rows: list[tuple[str, Outcome]]) -> Any:
        outcomes = [outcome for _, outcome in rows]
        # as JSON in ASCII: texts in netCDF end at a zero and must be valid Unicode
        texts = [json.dumps([*(getattr(one, k) for k in _TEXTS), *one.words]) for one in outcomes]
        data: dict[str, Any] = {
            "key": (("run",), np.array([key for key, _ in rows], dtype=object)),
            "status": (("run",), np.array([one.status for one in outcomes], dtype=object)),
            "texts": (("run",), np.array(texts, dtype=object)),
        }
        for name, dim, arrays in (
            ("numbers", "number", [one.numbers for one in outcomes]),
            ("final", "entry", [one.final for one in outcomes]),
        ):
            if arrays[0].size:
                data[name] = (("run", dim), np.array(arrays))
        plain = [
            [*one[:1], [list(axis) for axis in one.axes], *one[2:]] for one in layout.quantities
        ]
        dataset = self._xarray.Dataset(data, attrs={"layout": json.dumps(plain)})
        return dataset.assign_attrs(format=_FORMAT, checksum=_checksum(dataset))

    def _read(self, part: Path, wanted: set[str]) -> Iterator[tuple[str, Outcome]]:
        with self._xarray.open_dataset(part, engine="netcdf4", decode_cf=False) as dataset:
            if dataset.attrs.get("format") != _FORMAT:
                raise ValueError("it is of another format")
            keys = [str(one) for one in dataset["key"].values]
            if wanted.isdisjoint(keys):
                return
            dataset.load()
        if dataset.attrs["checksum"] != _checksum(dataset):
            raise ValueError("its checksum does not fit: what it holds has been changed")
        layout = _layout(json.loads(dataset.attrs["layout"]))
        nothing = np.zeros((len(keys), 0))
        numbers, final = (
            dataset[name].values if name in dataset else nothing for name in ("numbers", "final")
        )
        if numbers.shape[1] != layout.numbers:
            raise ValueError("its numbers do not fit its layout")
        for k, key in enumerate(keys):
            if key in wanted:
                said = json.loads(str(dataset["texts"].values[k]))
                yield (
                    key,
                    Outcome(
                        layout=layout,
                        numbers=np.array(numbers[k]),
                        words=tuple(said[len(_TEXTS) :]),
                        final=np.array(final[k]),
                        **dict(zip(_TEXTS, said, strict=False)),
                    ),
                )


def _checksum(dataset: Any) -> str:
    digest = hashlib.sha256(dataset.attrs["layout"].encode())
    for name in sorted(dataset.variables):
        values = dataset[name].values
        texts = values.dtype.kind not in "fiu"
        digest.update(name.encode())
        digest.update("\0".join(map(str, values)).encode() if texts else values.tobytes())
    return digest.hexdigest()


def _layout(plain: list[Any]) -> Layout:
    def axis(name: str, labels: list[Any], *rest: Any) -> Axis:
        return Axis(name, tuple(labels), *rest)

    quantities = (Quantity(one[0], tuple(axis(*of) for of in one[1]), *one[2:]) for one in plain)
    return Layout(tuple(quantities)) if plain else NOTHING

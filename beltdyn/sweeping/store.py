"""The store of a sweep: a folder of netCDF files, one for each part, written as the sweep goes.

A part is complete or not there: it is written beside its place and then renamed. Runs are found by
the key of their content (:mod:`beltdyn.sweeping.content`), whatever sweep has put them there.
"""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .. import files
from ..optional import optional_module
from .rows import NOTHING, Axis, Layout, Outcome, Quantity
from .table import variables

__all__ = ["Store"]

_FORMAT = 1
_ENDING = ".nc"
#: Between two parts: at least so long [s], this share of the time since the sweep began, at most.
_LEAST, _SHARE, _MOST = 2.0, 0.01, 300.0
#: Runs that did not end by themselves are not kept.
_KEPT = ("finished", "refused", "failed", "measure")
_TEXTS = ("key", "status", "message", "warnings", "kernels")


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
            if not one.name.startswith(".") and not one.name.startswith("part-")
        ]
        if others:
            raise ValueError(
                f"store {self._path}: the folder holds something else, {others[0]}; a store is a "
                "folder of its own"
            )
        self._waiting: list[tuple[str, Outcome]] = []
        self._begun = self._written = time.monotonic()

    def find(self, keys: Collection[str]) -> dict[str, Outcome]:
        """Give the outcomes that are there.

        Raises:
            ValueError: A part is damaged.
        """
        wanted, found = set(keys), {}
        for part in sorted(self._path.glob(f"part-*{_ENDING}")):
            try:
                found.update({key: outcome for key, outcome in self._read(part) if key in wanted})
            except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
                raise ValueError(
                    f"store {self._path}: {part.name} cannot be read ({error}): remove it, and its "
                    "runs are done again"
                ) from error
        return found

    def add(self, key: str, outcome: Outcome) -> None:
        """Keep an outcome; it is written soon.

        Raises:
            OSError: The part cannot be written.
        """
        if outcome.status in _KEPT:
            self._waiting.append((key, outcome))
        now = time.monotonic()
        pause = min(max(_LEAST, _SHARE * (now - self._begun)), _MOST)
        if now - self._written >= pause:
            self.flush()

    def flush(self) -> None:
        """Write what waits.

        Raises:
            OSError: A part cannot be written.
        """
        by_layout: dict[Layout, list[tuple[str, Outcome]]] = {}
        for key, outcome in self._waiting:
            by_layout.setdefault(outcome.layout, []).append((key, outcome))
        for layout, rows in by_layout.items():
            part = self._path / f"part-{time.time_ns():020d}-{secrets.token_hex(4)}{_ENDING}"
            dataset = self._dataset(layout, rows)
            with files.replacing(part) as temporary:
                dataset.to_netcdf(temporary, engine="netcdf4")
        self._waiting.clear()
        self._written = time.monotonic()

    def _dataset(self, layout: Layout, rows: list[tuple[str, Outcome]]) -> Any:
        outcomes = [outcome for _, outcome in rows]
        texts = {
            name: [getattr(outcome, name) for outcome in outcomes]
            for name in _TEXTS
            if name != "key"
        }
        texts["key"] = [key for key, _ in rows]
        data: dict[str, Any] = {
            f"run_{name}": (("run",), np.array(values, dtype=object))
            for name, values in texts.items()
        }
        numbers = np.array([outcome.numbers for outcome in outcomes])
        words = [outcome.words for outcome in outcomes]
        parts = variables(layout, numbers, words)
        for one, values in zip(layout.quantities, parts, strict=True):
            data[one.name] = (("run", *(axis.name for axis in one.axes)), values)
        for size in {outcome.final.size for outcome in outcomes} - {0}:
            final = np.full((len(rows), size), np.nan)
            for k, outcome in enumerate(outcomes):
                if outcome.final.size == size:
                    final[k] = outcome.final
            data[f"run_final_{size}"] = (("run", f"state_{size}"), final)
        attributes = {"format": _FORMAT, "layout": json.dumps(_plain(layout))}
        return self._xarray.Dataset(data, attrs=attributes)

    def _read(self, part: Path) -> Iterator[tuple[str, Outcome]]:
        with self._xarray.open_dataset(part, engine="netcdf4", decode_cf=False) as dataset:
            if dataset.attrs.get("format") != _FORMAT:
                raise ValueError("it is of another format")
            dataset.load()
        layout = _layout(json.loads(dataset.attrs["layout"]))
        n = dataset.sizes["run"]
        numbers, words = [np.zeros((n, 0))], [np.zeros((n, 0), dtype=object)]
        for one in layout.quantities:
            values = dataset[one.name].values.reshape(n, one.size)
            (words if one.words else numbers).append(values)
        rows, texts = np.concatenate(numbers, axis=1), np.concatenate(words, axis=1)
        finals = [
            dataset[name].values for name in dataset.data_vars if str(name).startswith("run_final_")
        ]
        said = {name: [str(one) for one in dataset[f"run_{name}"].values] for name in _TEXTS}
        for k in range(n):
            final = next((one[k] for one in finals if not np.isnan(one[k]).all()), np.zeros(0))
            fields = {name: said[name][k] for name in _TEXTS if name != "key"}
            yield (
                said["key"][k],
                Outcome(
                    layout=layout,
                    numbers=np.array(rows[k]),
                    words=tuple(map(str, texts[k])),
                    final=np.array(final),
                    **fields,
                ),
            )


def _plain(layout: Layout) -> list[Any]:
    return [[*one[:1], [list(axis) for axis in one.axes], *one[2:]] for one in layout.quantities]


def _layout(plain: list[Any]) -> Layout:
    if not plain:
        return NOTHING
    return Layout(
        tuple(
            Quantity(
                name,
                tuple(
                    Axis(axis, tuple(labels), size, units, text)
                    for axis, labels, size, units, text in axes
                ),
                units_of,
                text_of,
                words,
            )
            for name, axes, units_of, text_of, words in plain
        )
    )

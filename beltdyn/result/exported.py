"""Results as files that other programs read: netCDF, CSV, MATLAB."""

from __future__ import annotations

import csv
import errno
import os
import shutil
from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from ..base import files
from ..base.optional import optional_module
from ..outputs.quantity import QUANTITIES, TIME
from ..outputs.sampled import Sampled
from .labelled import unit_in

#: Kinds of file a result can be written as, by their ending, and the modules and extra they need.
RESULTS: Mapping[str, tuple[tuple[str, ...], str]] = {
    ".npz": ((), ""),
    ".nc": (("xarray", "netCDF4"), "sweep"),
    ".csv": ((), ""),
    ".mat": (("scipy.io",), "vibration"),
}


def check_ending(path: str | os.PathLike[str], endings: Iterable[str] = tuple(RESULTS)) -> str:
    """Return the ending, in lower case, that sets the format of a file; without one, the first."""
    known = tuple(endings)
    name = Path(path).name  # ".csv" has no suffix
    ending = Path("a" + name).suffix.lower() or known[0]
    if ending not in known:
        listed = " or ".join(filter(None, [", ".join(known[:-1]), known[-1]]))
        raise ValueError(f"cannot write {os.fspath(path)}: its ending must be {listed}")
    modules, extra = RESULTS[ending]
    for module in modules:
        optional_module(module, f"a {ending} file", extra)
    return ending


def write(run: Sampled, path: str | os.PathLike[str], ending: str) -> None:
    """Write a result as ``.csv`` or ``.mat``; see :meth:`beltdyn.Result.save`."""
    with files.replacing(path) as temporary:
        if ending == ".csv":
            _write_csv(temporary, run)
            return
        structs: dict[str, Any] = {"t": run.t, "scene": run.params.to_toml()}
        for name, values in run._arrays().items():
            group, _, field = name.partition(".")
            if field:
                structs.setdefault(group, {})[field] = values
            else:
                structs[group] = values
        savemat = optional_module("scipy.io", "a .mat file", "vibration").savemat
        savemat(temporary, structs, appendmat=False, oned_as="column")


def _write_csv(path: Path, run: Sampled) -> None:
    heads, arrays = [f"t ({TIME.unit})"], run._arrays()
    for name, values in arrays.items():
        unit = unit_in(QUANTITIES[name], run.params)
        for at in np.ndindex(values.shape[1:]):
            place = f"[{','.join(map(str, at))}]" if at else ""
            heads.append(f"{name}{place} ({unit})")
    with open(path, "w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file)
        lines.writerow(heads)
        for k, time in enumerate(run.t.tolist()):
            # Python writes as many digits as are needed to read the same number again.
            numbers = (np.ravel(values[k]).tolist() for values in arrays.values())
            lines.writerow([time, *chain.from_iterable(numbers)])


def write_netcdf(dataset: Any, path: str | os.PathLike[str]) -> None:
    """Write an ``xarray.Dataset`` as a netCDF file, in one step."""
    with files.replacing(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine="netcdf4")
        except (RuntimeError, PermissionError) as error:
            # The library of netCDF does not say why, or denies permission for a file made just now.
            said = error if isinstance(error, RuntimeError) else "NetCDF could not write it"
            free = shutil.disk_usage(temporary.parent).free
            raise OSError(
                errno.EIO, f"{said}, with {free / 1e6:.3g} MB free on that disk"
            ) from error

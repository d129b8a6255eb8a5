"""Shared parts of pictures of sweeps: checks, selection, axes of swept values, failed runs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ..base.checks import Array, one_of, shown
from ..base.optional import optional_module
from . import style

#: How runs that gave no value are shown, by their status: hatch, marker, word.
FAILED_LOOKS = {
    "refused": ("////", "x", "refused"),
    "failed": ("xxxx", "+", "failed"),
    "measure": ("....", "1", "no measure"),
    "lost": ("\\\\\\\\", "2", "worker lost"),
    "missing": ("", "|", "not computed"),
    "finished": ("----", "_", "no value"),
    "infinite": ("oo", "^", "without end"),
}
#: Texts longer than this do not fit along an axis; the name is there instead.
_LONGEST = 48
#: Values are geometric that span this ratio, with logarithms so many times as even as they are.
_RATIO, _EVENER = 4.0, 2.0
#: A value chosen is one of the coordinate up to this part of it.
_SAME = 1e-9
_EQUATION = re.compile(r" \(\d+\.\d+\)$")
_OF_RUNS = ("status", "message", "warnings")


def check_names(known: Sequence[str], **named: object) -> None:
    """Check the two names given for axes, None where none is."""
    for field, name in named.items():
        if name is not None:
            one_of(field, name, known)
    one, other = named.values()
    if one is not None and one == other:
        raise ValueError(f"{' and '.join(named)} must differ, both are {one!r}")


def too_many(part: Any, quantity: str, one: str, but: str) -> ValueError:
    """Return the error of a quantity with a dimension more than a picture has axes."""
    first = part[one].values[0].item()
    return ValueError(
        f"{quantity} has the dimensions {', '.join(map(str, part[quantity].dims))}: {but} by at="
        f"{{{one!r}: {first!r}}}"
    )


def swept_names(dataset: Any) -> list[str]:
    """Return the swept names: dimensions of a grid, else coordinates of the runs."""
    dims = [str(dim) for dim in dataset["status"].dims]
    if dims == ["run"]:
        along = [name for name, one in dataset.coords.items() if one.dims == ("run",)]
        return [str(name) for name in along if name != "run"]
    return dims


def choose(dataset: Any, quantity: object, at: object, named: Sequence[object]) -> tuple[Any, str]:
    """Return the part of a sweep at some values, with this quantity alone, and these as a text.

    Dimensions of one value are left out unless they are ``named`` for an axis.
    """
    _check(dataset, quantity)
    part = dataset[[quantity, "status"]]
    if not (at is None or isinstance(at, Mapping)):
        raise TypeError(f"at must be a dict of values by name, got {shown(at)}")
    texts = []
    for name, value in (at or {}).items():
        if name not in part.dims:
            known = [str(dim) for dim in part.dims]
            raise ValueError(
                f"at: there is no dimension {shown(name)}, there are {', '.join(known)}"
            )
        k = _index(part, str(name), value)
        part = part.isel({name: k})
        texts.append(_value_text(part[name]) if name in part.coords else f"{name} {k}")
    single = [dim for dim in part.dims if part.sizes[dim] == 1 and dim not in named]
    return part.compute().squeeze(single), "; ".join(texts)


def _check(dataset: object, quantity: object) -> None:
    xarray = optional_module("xarray", "a picture of a sweep", "sweep")
    if not isinstance(dataset, xarray.Dataset):
        raise TypeError(f"dataset must be the xarray.Dataset of bd.sweep, got {shown(dataset)}")
    if "status" not in dataset.data_vars:
        raise ValueError("dataset must be that of bd.sweep, it has no variable 'status'")
    known = [
        str(name)
        for name, array in dataset.data_vars.items()
        if array.dtype.kind in "iufb" and name not in _OF_RUNS
    ]
    one_of("quantity", quantity, known or ["(none)"])


def _index(part: Any, name: str, value: Any) -> int:
    values = part[name].values  # their numbers, of a dimension without a coordinate
    if values.dtype.kind not in "iuf":
        found = np.flatnonzero(values.astype(str) == str(value))
    elif isinstance(value, str) or not np.isscalar(value):
        found = np.array([], dtype=int)
    elif name == "time":
        nearest = int(np.argmin(np.abs(values - value)))
        within = values.min() <= value <= values.max()
        found = np.array([nearest] if within else [], dtype=int)
    else:
        found = np.flatnonzero(np.isclose(values, value, rtol=_SAME, atol=0.0))
    if not found.size:
        some = ", ".join(str(one) for one in values[:8]) + (", ..." if values.size > 8 else "")
        raise ValueError(f"at[{name!r}] must be one of {some}, got {shown(value)}")
    return int(found[0])


# --- words ---------------------------------------------------------------------------------------


def label(array: Any) -> str:
    """Return the label of an axis: the text of the array, or its name, and the unit."""
    unit = str(array.attrs.get("units", ""))
    return _word(array) + (f" [{style.plain(unit)}]" if unit else "")


def _word(array: Any) -> str:
    # without the number of an equation, which parameters have at their end: "... (2.9)"
    text = _EQUATION.sub("", str(array.attrs.get("long_name", "")))
    return style.plain(text if 0 < len(text) <= _LONGEST else str(array.name))


def _value_text(one: Any) -> str:
    """Return the name of a coordinate, its value and its unit."""
    value, unit = one.item(), str(one.attrs.get("units", ""))
    text = f"{value:.5g}" if one.dtype.kind in "iuf" else style.plain(str(value))
    shown_unit = one.dtype.kind in "iuf" and unit not in ("", "1")
    return f"{_word(one)} {text}" + (f" {style.plain(unit)}" if shown_unit else "")


# --- axes ----------------------------------------------------------------------------------------


@attrs.frozen(eq=False, kw_only=True)
class Scale:
    """A coordinate along an axis."""

    name: str
    label: str
    places: Array  # (n,); of texts their numbers
    texts: tuple[str, ...] | None  # the distinct texts, of texts alone
    log: bool

    @property
    def order(self) -> NDArray[np.intp]:
        """Indices that bring the places into rising order (n,)."""
        return np.argsort(self.places, kind="stable")

    @property
    def ranks(self) -> NDArray[np.intp]:
        """Rank of each place among the distinct ones (n,)."""
        return np.unique(self.places, return_inverse=True)[1]

    def edges(self) -> Array:
        """Return the edges of cells round the places in rising order, half way between (n + 1,)."""
        at = np.sort(np.log(self.places) if self.log else self.places)
        if at.size == 1:
            half = 0.5 if self.texts or at[0] == 0.0 else 0.05 * abs(at[0])
            edges = np.array([at[0] - half, at[0] + half])
        else:
            middle = 0.5 * (at[1:] + at[:-1])
            edges = np.concatenate([[2.0 * at[0] - middle[0]], middle, [2.0 * at[-1] - middle[-1]]])
        return np.exp(edges) if self.log else edges

    def apply(self, ax: Axes, which: str) -> None:
        """Set the scale of the "x" or "y" axis, and texts as its ticks."""
        if self.log:
            ax.set(**{f"{which}scale": "log"})
        if self.texts is not None:
            axis = ax.xaxis if which == "x" else ax.yaxis
            axis.set_ticks(list(range(len(self.texts))), labels=list(self.texts))


def scale_of(dataset: Any, name: str) -> Scale:
    """Return the scale of a coordinate, or of the numbers along a dimension without one."""
    known, found, texts = name in dataset.coords, dataset[name].values, None
    if found.dtype.kind not in "iuf":
        names = [style.plain(str(one)) for one in found]
        texts = tuple(dict.fromkeys(names))
        found = [texts.index(one) for one in names]
    places = np.asarray(found, dtype=np.float64)
    return Scale(
        name=name,
        label=label(dataset[name]) if known else name,
        places=places,
        texts=texts,
        log=known and texts is None and _geometric(places),
    )


def _geometric(values: Array) -> bool:
    """Whether values are spread more evenly on a logarithmic scale than on a linear one."""
    # A few by their steps; many, which may be random, by where their middle is.
    distinct = np.unique(values)
    if distinct.size < 3 or distinct[0] <= 0.0 or distinct[-1] < _RATIO * distinct[0]:
        return False

    def unevenness(at: Array) -> float:
        if at.size <= 20:
            steps = np.diff(at)
            return float(steps.std() / steps.mean())
        return abs(float((np.median(at) - at[0]) / (at[-1] - at[0])) - 0.5)

    return _EVENER * unevenness(np.log(distinct)) <= unevenness(distinct) + 1e-12


# --- failures ------------------------------------------------------------------------------------


def mark(status: str) -> dict[str, Any]:
    """Return the look of a failed run as a point."""
    return {"linestyle": "none", "marker": FAILED_LOOKS[status][1], "markersize": 5.0}


def failures(part: Any, quantity: str) -> dict[str, tuple[Any, str]]:
    """Find the runs without a value: by status where they are, and a text that counts them."""
    status, array = part["status"], part[quantity]
    own = [dim for dim in array.dims if dim not in status.dims]
    found = {}
    absent = array.isnull()
    for name, (_, _, word) in FAILED_LOOKS.items():
        of_name = counted = status == name
        where = absent.where(of_name, False).astype(bool)
        unit = "run"
        if name in ("finished", "infinite"):
            where = counted = where if name == "finished" else abs(array) == np.inf
            unit = "value" if own else "run"
        if count := int(counted.sum()):
            plural = "" if count == 1 else "s"
            found[name] = (where, f"{word}: {count} {unit}{plural}")
    return found

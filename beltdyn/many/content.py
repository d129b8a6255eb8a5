"""Content hash of a run: equal inputs, equal key.

A scene is laid out flat, one entry for each number, by the names that sweeps have for them. The
key of a run of a sweep comes from this layout with the swept values put in, so that a run that
another sweep has done already is found again.
"""

from __future__ import annotations

import functools
import hashlib
import numbers
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import attrs
import numpy as np

from .. import _core
from ..base.naming import index_of
from ..drive.scene import Scene
from ..loads.motions import Motion, as_motions
from ..loads.torques import TorqueSum
from .identity import NoKeyError, token

#: Raised whenever what a run gives for the same content may have changed.
_FORMAT = 2

Leaf = tuple[str, str]


class Place(NamedTuple):
    """Where a value stands in the layout."""

    roots: list[str]  # under these names
    factor: bool  # whether it is a factor, else 1


class Contents:
    """The keys of many runs of a scene."""

    def __init__(
        self,
        scene: Scene,
        options: Mapping[str, Any],  # all of them
        places: Sequence[Place],  # of the values that differ
        measured: str,  # text of the measured quantities
        key: str = "",  # the user's own name of what functions do
    ) -> None:
        self._of_functions = key
        self._pulleys = scene.params.pulley_names
        self._places = places
        leaves = [
            *self._leaves("params", scene.params),
            *self._leaves("torque", scene.torque_fn),
            *self._leaves("motion", scene.motion or None),
            *self._leaves("t_end", scene.t_end),
            *(one for name in options for one in self._leaves(f"option.{name}", options[name])),
        ]
        roots = [root for place in places if not place.factor for root in place.roots]
        roots += [_OTHER[root] for root in roots if root in _OTHER]
        self._of_functions = ""  # functions that are swept must differ by their content
        #: What no run changes, and what those change that have a value there.
        self._base = _sum(leaf for leaf in leaves if not _within(leaf[0], roots))
        self._head = f"{_FORMAT} {_core.__version__} {_build()} {measured} {key!r}"
        if any(_within(a, [b]) for k, a in enumerate(roots) for b in roots[:k] + roots[k + 1 :]):
            self._head += f" in the order {roots}"  # one is put into the other

    def key(self, values: Sequence[Any], before: str = "") -> str:
        """Return the key of a run by its values, and what else it depends on."""
        total = self._base
        for (roots, factor), value in zip(self._places, values, strict=True):
            if factor and _is_one(value):
                continue
            for root in roots:
                total += _sum(self._leaves(root, value))
                if root in _OTHER and value is not None:
                    total += _sum([(_OTHER[root], repr(None))])
        text = f"{self._head} {before} {total % 2**256:x}"
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def _leaves(self, name: str, node: Any) -> Iterator[Leaf]:
        """Lay out a value: a text for each part of it, by its name."""
        if isinstance(node, np.generic):
            node = node.item()
        if isinstance(node, str) and name.endswith(".pulley"):
            with suppress(ValueError):
                node = index_of("pulley", node, self._pulleys)
        if node is None or isinstance(node, (bool, str)):
            yield name, repr(node)
        elif isinstance(node, (int, float)):
            yield name, _number(node)
        elif name == "torque" and _is_own(node):
            for k, part in enumerate(parts_of(node)):
                yield from self._leaves(f"torque[{k}]", part)
        elif name == "motion" and isinstance(node, Mapping):
            motions: Any = node
            with suppress(TypeError, ValueError):  # refused when it is run
                motions = as_motions(node, self._pulleys)
            for at, motion in motions.items():
                yield from self._leaves(f"motion[{at}]", speed_of(motion))
        elif _is_own(node):
            yield name, type(node).__name__
            for field in attrs.fields(type(node)):
                if field.init:
                    yield from self._leaves(f"{name}.{field.name}", getattr(node, field.name))
        elif isinstance(node, Sequence) or (
            isinstance(node, np.ndarray) and node.ndim and node.dtype.kind in "fiub"
        ):
            values = node.tolist() if isinstance(node, np.ndarray) else node
            yield name, f"row of {len(values)}"
            for k, one in enumerate(values):
                yield from self._leaves(f"{name}[{k}]", one)
        else:
            yield name, token(node, self._of_functions)


@contextmanager
def needing_keys(remedy: str = "") -> Iterator[None]:
    """Raise an error of runs whose content cannot be known as one of the store."""
    try:
        yield
    except NoKeyError as error:
        raise ValueError(
            f"store: runs are known by their content, and {error}; leave store out{remedy}"
        ) from None


@functools.cache
def _build() -> str:
    """Return a hash of the files of this package: two builds of a version may differ."""
    digest = hashlib.sha256()
    for file in (Path(_core.__file__), *sorted(Path(__file__).parent.parent.rglob("*.py"))):
        digest.update(file.read_bytes())
    return digest.hexdigest()


#: Of two fields one replaces the other.
_OTHER = {"params.belt.length": "params.belt.preload", "params.belt.preload": "params.belt.length"}


def _is_own(node: Any) -> bool:
    """Whether an object is a part of a drive, a load or a state, defined by its fields."""
    kind = type(node)
    return attrs.has(kind) and kind.__module__.startswith(f"{__name__.partition('.')[0]}.")


def parts_of(torque: Any) -> tuple[Any, ...]:
    """Return the torques of a sum, of another the torque alone."""
    return torque.parts if isinstance(torque, TorqueSum) else (torque,)


def speed_of(motion: Any) -> Any:
    """Return the speed of a motion that is one, whose fields are called as in a scene file."""
    return motion.speed if isinstance(motion, Motion) and motion.speed is not None else motion


def _is_one(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool) and value == 1


def _number(value: int | float) -> str:
    """Return a number as text, the same for an integer and an equal float."""
    try:
        return float(value).hex() if float(value) == value or value != value else repr(value)
    except OverflowError:
        return repr(value)


def _sum(leaves: Iterable[Leaf]) -> int:
    """Return one number for entries in any order, so that a few can be exchanged quickly."""
    texts = ("\0".join(leaf).encode("utf-8", "surrogatepass") for leaf in leaves)
    return sum(int.from_bytes(hashlib.sha256(text).digest()) for text in texts)


def _within(name: str, roots: Iterable[str]) -> bool:
    return any(name == root or name.startswith((f"{root}.", f"{root}[")) for root in roots)

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
from pathlib import Path
from typing import Any, NamedTuple

import attrs
import numpy as np

from .. import _core
from ..base.naming import index_of
from ..drive.scene import Scene
from ..loads.motions import Motion, as_motions
from ..loads.torques import TorqueSum
from .identity import token

__all__ = ["Contents", "Place"]

#: Raised whenever what a run gives for the same content may have changed.
_FORMAT = 2
_DIGEST = 32  #: Bytes of a digest.

Leaf = tuple[str, str]


class Place(NamedTuple):
    """Where a value stands in the layout: under these names; a factor, else 1, or the value."""

    roots: list[str]
    factor: bool


class Contents:
    """The keys of many runs of a scene.

    Args:
        scene: The scene, common to all runs.
        options: All options of the runs, by name, common to them.
        places: Where the values stand that differ.
        measured: Text of the measured quantities.
        key: The user's own name of what functions do.

    Raises:
        NoKeyError: A function among them has no content that can be known.
    """

    def __init__(
        self,
        scene: Scene,
        options: Mapping[str, Any],
        places: Sequence[Place],
        measured: str,
        key: str = "",
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
        """Return the key of a run.

        Args:
            values: Its values.
            before: What else it depends on, such as the key of the run whose end it starts from.
        """
        total = self._base
        for (roots, factor), value in zip(self._places, values, strict=True):
            if factor and _is_one(value):
                continue
            for root in roots:
                total += _sum(self._leaves(root, value))
                if root in _OTHER and value is not None:
                    total += _sum([(_OTHER[root], repr(None))])
        text = f"{self._head} {before} {total % 2 ** (8 * _DIGEST):x}"
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def _leaves(self, name: str, node: Any) -> Iterator[Leaf]:
        """Lay out a value: a text for each part of it, by its name."""
        if isinstance(node, np.generic):
            node = node.item()
        if isinstance(node, str) and name.endswith(".pulley"):
            node = self._index(node)
        if node is None or isinstance(node, (bool, str)):
            yield name, repr(node)
        elif isinstance(node, (int, float)):
            yield name, _number(node)
        elif name == "torque" and isinstance(node, TorqueSum):
            for k, part in enumerate(node.parts):
                yield from self._leaves(f"torque[{k}]", part)
        elif name == "torque" and _is_own(node):
            yield from self._leaves("torque[0]", node)
        elif name == "motion" and isinstance(node, Mapping):
            for at, motion in self._motions(node).items():
                yield from self._leaves(f"motion[{at}]", motion)
        elif _is_own(node):
            yield name, type(node).__name__
            for field in attrs.fields(type(node)):
                if field.init:
                    yield from self._leaves(f"{name}.{field.name}", getattr(node, field.name))
        elif isinstance(node, Sequence) or (
            isinstance(node, np.ndarray) and node.ndim and node.dtype.kind in "fiub"
        ):
            yield from self._row(name, node)
        else:
            yield name, token(node, self._of_functions)

    def _row(self, name: str, node: Any) -> Iterator[Leaf]:
        values = node.tolist() if isinstance(node, np.ndarray) else node
        yield name, f"row of {len(values)}"
        for k, one in enumerate(values):
            yield from self._leaves(f"{name}[{k}]", one)

    def _index(self, pulley: str) -> int | str:
        try:
            return index_of("pulley", pulley, self._pulleys)
        except ValueError:
            return pulley

    def _motions(self, motion: Any) -> dict[Any, Any]:
        """Return motions by index, each as its speed where it has one."""
        try:
            found = as_motions(motion, self._pulleys)
        except (TypeError, ValueError):  # refused when it is run
            return dict(motion)
        return {
            at: one.speed if isinstance(one, Motion) and one.speed is not None else one
            for at, one in found.items()
        }


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


def _is_one(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool) and value == 1


def _number(value: int | float) -> str:
    """Return a number as text, the same for an integer and an equal float."""
    try:
        return float(value).hex() if float(value) == value or value != value else repr(value)
    except OverflowError:
        return repr(value)


def _digest(leaf: Leaf) -> bytes:
    return hashlib.sha256("\0".join(leaf).encode("utf-8", "surrogatepass")).digest()


def _sum(leaves: Iterable[Leaf]) -> int:
    """Return one number for entries in any order, so that a few can be exchanged quickly."""
    return sum(int.from_bytes(_digest(leaf)) for leaf in leaves)


def _within(name: str, roots: Iterable[str]) -> bool:
    return any(name == root or name.startswith((f"{root}.", f"{root}[")) for root in roots)

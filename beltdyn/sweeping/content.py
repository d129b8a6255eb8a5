"""What a run is made of, as a key: the same content gives the same key, however it was put.

A scene is laid out flat, one entry for each number, by the names of :mod:`beltdyn.sweeping.names`.
The key of a run of a sweep comes from this layout with the swept values put in, so that a run that
another sweep has done already is found again.
"""

from __future__ import annotations

import hashlib
import numbers
import pickle
import types
from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from .. import _core
from ..motions import as_motions
from ..scene import Scene
from .names import find

__all__ = ["Contents", "NoKeyError", "token"]

#: Raised whenever what a run gives for the same content may have changed.
_FORMAT = 1


class NoKeyError(ValueError):
    """Something whose content cannot be known: a compiled function, an object that has none."""


def token(value: Any) -> str:
    """Give a text that tells values apart that give different runs.

    Of a Python function it is of its code, defaults and what it encloses, not of the functions and
    modules that it uses.

    Raises:
        NoKeyError: The content cannot be known.
    """
    return hashlib.sha256(repr(sorted(_leaves("", value).items())).encode()).hexdigest()[:32]


def _leaves(name: str, node: Any) -> dict[str, str]:
    """Lay out a value flat: a text for each part of it, by its name."""
    if isinstance(node, np.generic):
        node = node.item()
    if node is None or isinstance(node, (bool, str)):
        return {name: repr(node)}
    if isinstance(node, numbers.Real):
        return {name: float(node).hex()}
    if isinstance(node, bytes):
        return {name: hashlib.sha256(node).hexdigest()}
    if isinstance(node, np.ndarray):
        if node.dtype.hasobject:
            return _leaves(name, node.tolist())
        data = np.ascontiguousarray(node)
        digest = hashlib.sha256(data.tobytes()).hexdigest()
        return {name: f"{data.dtype.str} {data.shape} {digest}"}
    if attrs.has(type(node)):
        found = {f"{name}.class": type(node).__name__}
        for field in attrs.fields(type(node)):
            if field.init:
                found |= _leaves(f"{name}.{field.name}", getattr(node, field.name))
        return found
    if isinstance(node, Mapping):
        found = {f"{name}.keys": repr(sorted(map(repr, node)))}
        for key in sorted(node, key=repr):
            found |= _leaves(f"{name}[{key!r}]", node[key])
        return found
    if isinstance(node, (list, tuple)):
        found = {f"{name}.length": str(len(node))}
        for k, one in enumerate(node):
            found |= _leaves(f"{name}[{k}]", one)
        return found
    return {name: _of_function(node)}


def _of_function(node: Any) -> str:
    """Give a text for a function or for an object that is called like one."""
    if isinstance(node, types.MethodType):
        return f"method {_of_function(node.__func__)} {token(node.__self__)}"
    if isinstance(node, types.FunctionType):
        cells = [cell.cell_contents for cell in node.__closure__ or ()]
        held = [node.__defaults__, node.__kwdefaults__, cells]
        return f"function {_of_code(node.__code__)} {token(held)}"
    if isinstance(node, types.BuiltinFunctionType) and node.__module__ is not None:
        return f"{node.__module__}.{node.__qualname__}"
    if isinstance(node, type):
        return f"{node.__module__}.{node.__qualname__}"
    if isinstance(node, types.ModuleType):
        return node.__name__
    own = vars(type(node)).get("__call__")
    if isinstance(own, types.FunctionType) and hasattr(node, "__dict__"):
        return f"object {_of_code(own.__code__)} {token(vars(node))}"
    try:
        return f"{type(node).__qualname__} {hashlib.sha256(pickle.dumps(node, 5)).hexdigest()}"
    except Exception:
        raise NoKeyError(f"what {node!r} does cannot be known from outside") from None


def _of_code(code: types.CodeType) -> str:
    inner = [_constant(one) for one in code.co_consts]
    parts = [code.co_code.hex(), repr(code.co_names), repr(inner)]
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()


def _constant(value: Any) -> str:
    if isinstance(value, types.CodeType):
        return _of_code(value)
    if isinstance(value, frozenset):  # its order changes from process to process
        return repr(sorted(map(_constant, value)))
    return repr(value)


class Contents:
    """The keys of the runs of a sweep.

    Args:
        scene: What all runs have in common.
        options: Of simulate, the same.
        names: What differs.
        measured: Of the measured quantities, a text.
        version: The user's own, for what no key can see.

    Raises:
        NoKeyError: A function among them has no content that can be known.
    """

    def __init__(
        self,
        scene: Scene,
        options: Mapping[str, Any],
        names: Sequence[str],
        measured: str,
        version: str,
    ) -> None:
        motions = as_motions(scene.motion, scene.params.pulley_names)
        self._base = {
            **_leaves("params", scene.params),
            **_leaves("torque", scene.torque_fn),
            **_leaves("t_end", scene.t_end),
        }
        for at, motion in motions.items():
            self._base |= _leaves(f"motion[{at}]", motion)
        for name, value in options.items():
            self._base |= _leaves(f"option.{name}", value)
        self._places = [_places(scene, name) for name in names]
        self._head = f"{_FORMAT} {_core.__version__} {measured} {version}"

    def key(self, values: Sequence[Any], before: str = "") -> str:
        """Give the key of a run; ``before`` is that of the run whose end it starts from."""
        leaves = dict(self._base)
        for (roots, factor), value in zip(self._places, values, strict=True):
            for root in roots:
                if not factor:
                    inside = (f"{root}.", f"{root}[")
                    for name in [one for one in leaves if one == root or one.startswith(inside)]:
                        del leaves[name]
                elif value == 1.0:
                    continue
                leaves |= _leaves(root, value)
        text = f"{self._head} {before} {sorted(leaves.items())}"
        return hashlib.sha256(text.encode()).hexdigest()[:32]


def _places(scene: Scene, name: str) -> tuple[list[str], bool]:
    """Give where a name stands in the layout, and whether it is a factor, else 1."""
    root, path = find(scene, name)
    places = ["option" if root == "option" else root]
    node: Any = scene.params if root == "params" else None
    for step in path:
        if step == "*":
            count = len(node)
            places = [f"{place}[{k}]" for place in places for k in range(count)]
            node = node[0]
        elif isinstance(step, int):
            places = [f"{place}[{step}]" for place in places]
            node = node[step] if node is not None else None
        else:
            places = [f"{place}.{step}" for place in places]
            node = getattr(node, str(step)) if node is not None else None
    return places, bool(path) and path[-1] == "scale"

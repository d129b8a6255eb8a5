"""Names of the values a sweep changes: numbers of the drive, loads, motions, options.

``"belt.preload"`` and all others of :mod:`beltdyn.drive.parameters`; ``"torque.scale"``, a factor
on all set torques; ``"torque[1].quadratic"``, a field of the second torque of a sum, as [[torque]]
of a scene file counts them; ``"motion[crank].scale"``, ``"motion[crank].amplitudes[0]"``;
``"t_end"``; ``"rtol"`` and other arguments of :func:`beltdyn.simulate`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import attrs
import numpy as np

from ..base.checks import close_to, real, shown
from ..base.naming import label
from ..base.run_options import USUAL, Options
from ..drive.parameters import Path, assign, fields, numbers, parse, read, rule_of, with_indices
from ..drive.scene import Scene
from ..loads.motions import CrankMotion, Motion, MotionLike, as_motions
from ..loads.torques import PiecewiseLinear, Torque, TorqueLike, TorqueSum
from ..many.content import Place

__all__ = ["OPTIONS", "Named", "ScaledFunction", "changed", "find", "in_words", "place"]

#: Arguments of simulate that may differ between the runs of a sweep, with their defaults.
OPTIONS: Mapping[str, Any] = {
    **{name: getattr(USUAL, name) for name in Options.rows()},
    **{"t_eval": None, "verify": False, "initial": None},
}
_SCALE = "scale"


class Named(NamedTuple):
    """What a name stands for.

    Attributes:
        root: "params", "torque", "motion", "t_end" or "option".
        path: The steps from there, pulleys by index.
    """

    root: str
    path: Path


@attrs.frozen
class ScaledFunction:
    """A function times a number: a torque, or a speed or angle over time."""

    function: Any
    factor: float

    def __call__(self, *args: Any) -> Any:
        """Call the function."""
        return np.multiply(self.factor, self.function(*args))


def find(scene: Scene, name: object) -> Named:
    """Find what a name stands for in a scene."""
    path = with_indices(parse(name), scene.params.pulley_names)
    root = str(path[0])
    if root == "t_end" and len(path) == 1:
        return Named("t_end", ())
    if root in OPTIONS and len(path) == 1:
        return Named("option", path)
    if root == "torque":
        _look_in_torque(scene, str(name), path[1:])
        return Named("torque", path[1:])
    if root == "motion":
        _look_in_motion(scene, str(name), path[1:])
        return Named("motion", path[1:])
    if root not in fields(type(scene.params)):
        known = [*numbers(scene.params), "torque.scale", "motion.scale", "t_end", *OPTIONS]
        raise ValueError(f"nothing is called {name!r}{close_to(str(name), known)}")
    read(scene.params, str(name))
    return Named("params", path)


def place(scene: Scene, name: str) -> Place:
    """Return where a name stands in the layout of a key."""
    root, path = find(scene, name)
    places = [root]
    node: Any = scene.params if root == "params" else None
    for step in path:
        if step == "*":
            count = len(node)
            places = [f"{one}[{k}]" for one in places for k in range(count)]
            node = node[0]
        elif isinstance(step, int):
            places = [f"{one}[{step}]" for one in places]
            node = node[step] if node is not None else None
        else:
            places = [f"{one}.{step}" for one in places]
            node = getattr(node, str(step)) if node is not None else None
    return Place(places, bool(path) and path[-1] == _SCALE)


def in_words(scene: Scene, name: str) -> tuple[str, str]:
    """Return the unit and the text of what a name stands for, "" where none is known."""
    found = find(scene, name)
    if found.root == "t_end":
        return "s", "end of the run"
    if found.root == "option":
        row = Options.rows().get(str(found.path[0]))
        unit = row.unit if row and row.kind is not np.ndarray else ""  # of one number
        return unit, f"{found.path[0]} of simulate"
    if found.root in ("torque", "motion"):
        if found.path and found.path[-1] == _SCALE:
            what = "set torques" if found.root == "torque" else "prescribed motion"
            return "1", f"factor on the {what}"
        return "", name
    rule = rule_of(scene.params, name)
    if rule is None:
        return "", name
    return rule.unit, rule.text


def changed(
    scene: Scene, options: Mapping[str, Any], changes: Mapping[str, Any]
) -> tuple[Scene, dict[str, Any]]:
    """Return the scene and the options with values changed, all at once."""
    new_options = dict(options)
    groups: dict[str, list[tuple[Path, Any]]] = {"params": [], "torque": [], "motion": []}
    t_end = scene.t_end
    for name, value in changes.items():
        root, path = find(scene, name)
        if root == "t_end":
            t_end = real("t_end", value, "s")
        elif root == "option":
            new_options[str(path[0])] = value
        else:
            groups[root].append((path, value))
    params = assign(scene.params, _length_or_preload(groups["params"]))
    torque = _torque_with(scene.torque_fn, groups["torque"])
    motion = _motion_with(scene, groups["motion"])
    return Scene(params, torque, t_end, motion), new_options


def _length_or_preload(changes: list[tuple[Path, Any]]) -> list[tuple[Path, Any]]:
    """Leave out the length of a belt where its preload is given, and the other way round."""
    given = dict(changes)
    for one, other in (("preload", "length"), ("length", "preload")):
        replaced = ("belt", other)
        if given.get(("belt", one)) is not None and replaced not in given:
            return [*changes, (replaced, None)]
    return changes


# --- Loads ----------------------------------------------------------------------------------------


def _parts(torque: TorqueLike) -> tuple[Any, ...]:
    return torque.parts if isinstance(torque, TorqueSum) else (torque,)


def _look_in_torque(scene: Scene, name: str, path: Path) -> None:
    if path in ((), (_SCALE,)):
        return
    torque = scene.torque_fn
    if not isinstance(torque, Torque):
        raise ValueError(
            f'{name}: the torque is a function: only "torque" and "torque.scale" can be changed'
        )
    parts = _parts(torque)
    at = path[0]
    if not isinstance(at, int):
        raise ValueError(
            f'{name}: torques are called by number, "torque[0].{at}", or "torque.scale"'
        )
    if at >= len(parts):
        raise ValueError(f"{name}: the torque has {len(parts)} part(s)")
    _look_in(parts[at], name, path[1:], f"torque[{at}]")


def _look_in(node: Any, name: str, path: Path, where: str) -> None:
    """Go along a path of fields and indices; the last field may be "scale"."""
    if path in ((), (_SCALE,)):
        return
    for k, step in enumerate(path):
        if isinstance(step, str):
            known = fields(type(node)) if attrs.has(type(node)) else []
            if step not in known:
                there = ", ".join([*known, _SCALE] if k == 0 else known)
                raise ValueError(f"{name}: {where} has {there or 'no fields'}, not {step!r}")
            node = getattr(node, step)
        else:
            if not isinstance(node, (tuple, np.ndarray)) or step >= len(node):
                raise ValueError(f"{name}: {where} has no [{step}]")
            node = node[step]
        where += f".{step}" if isinstance(step, str) else f"[{step}]"


def _scaled_torque(torque: TorqueLike, factor: object) -> TorqueLike:
    number = real("torque.scale", factor)
    if isinstance(torque, Torque):
        return torque * number
    if not callable(torque):
        raise ValueError("torque.scale: a compiled function cannot be multiplied by a number")
    return ScaledFunction(torque, number)


def _torque_with(torque: TorqueLike, changes: list[tuple[Path, Any]]) -> TorqueLike:
    for path, value in sorted(changes, key=_rank):
        if path == ():
            torque = value
        elif path == (_SCALE,):
            torque = _scaled_torque(torque, value)
        else:
            parts = list(_parts(torque))
            at = int(path[0])
            if path[1:] == (_SCALE,):
                parts[at] = _scaled_torque(parts[at], value)
            else:
                parts[at] = _with(parts[at], path[1:], value)
            torque = parts[0] if len(parts) == 1 else TorqueSum(parts)
    return torque


def _rank(change: tuple[Path, Any]) -> int:
    """Return the order of a change: the whole, its fields, factors on parts, on the whole."""
    path = change[0]
    if path and path[-1] == _SCALE:
        return 3 if len(path) == 1 else 2
    return 1 if path else 0


def _with(node: Any, path: Path, value: Any) -> Any:
    """Return a copy with one value changed."""
    if not path:
        return value
    step = path[0]
    if isinstance(step, str):
        inner = _with(getattr(node, step), path[1:], value)
        if isinstance(node, PiecewiseLinear) and step == "values" and np.ndim(inner) == 2:
            inner = inner[:, 0] if inner.shape[1] == 1 else inner
        return attrs.evolve(node, **{step: inner})
    if isinstance(node, np.ndarray):
        copy = np.array(node)
        copy[step] = _with(copy[step], path[1:], value)
        return copy
    return tuple(_with(one, path[1:], value) if k == step else one for k, one in enumerate(node))


# --- Motions --------------------------------------------------------------------------------------


def _look_in_motion(scene: Scene, name: str, path: Path) -> None:
    names = scene.params.pulley_names
    motions = as_motions(scene.motion, names)
    if path == ():
        return
    if not motions:
        raise ValueError(f"{name}: no motion is prescribed in this scene")
    if path == (_SCALE,):
        return
    at = path[0]
    if not isinstance(at, int) or at not in motions:
        there = ", ".join(f'"motion[{names[k]}]"' for k in motions)
        raise ValueError(f"{name}: motions are called by pulley: {there}")
    _look_in(_own(motions[at]), name, path[1:], f"motion of {label(at, names)}")


def _own(motion: Motion | CrankMotion) -> Any:
    """Return the speed of a motion that is one, whose fields are called as in a scene file."""
    return motion.speed if isinstance(motion, Motion) and motion.speed is not None else motion


def _scaled_motion(motion: Any, factor: object) -> MotionLike:
    number = real("motion.scale", factor)
    if isinstance(motion, CrankMotion):
        return attrs.evolve(motion, speed=motion.speed * number)
    if isinstance(motion, PiecewiseLinear):
        return motion * number
    if isinstance(motion, Motion):
        return Motion(angle=ScaledFunction(motion.angle, number))
    return Motion(speed=ScaledFunction(motion, number))


def _motion_with(scene: Scene, changes: list[tuple[Path, Any]]) -> Any:
    if not changes:
        return scene.motion
    whole = [value for path, value in changes if path == ()]
    if whole and not isinstance(whole[-1], Mapping):
        raise ValueError(f"motion must be a mapping by pulley, got {shown(whole[-1])}")
    given = whole[-1] if whole else scene.motion
    motions: dict[int, Any] = {
        k: _own(one) for k, one in as_motions(given, scene.params.pulley_names).items()
    }
    for path, value in sorted(changes, key=_rank):
        if path == (_SCALE,):
            motions = {k: _scaled_motion(one, value) for k, one in motions.items()}
        elif path:
            at = int(path[0])
            if path[1:] == (_SCALE,):
                motions[at] = _scaled_motion(motions[at], value)
            else:
                motions[at] = _with(motions[at], path[1:], value)
    return motions

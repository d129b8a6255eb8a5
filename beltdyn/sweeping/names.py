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

from ..base.checks import close_to, real
from ..base.naming import label
from ..base.run_options import USUAL, Options
from ..drive.parameters import Path, assign, fields, known, parse, read, rule_of, with_indices
from ..drive.scene import Scene
from ..loads.motions import CrankMotion, Motion, as_motions
from ..loads.torques import Torque, TorqueSum
from ..many.content import Place, parts_of, speed_of

#: Arguments of simulate that may differ between the runs of a sweep, with their defaults.
OPTIONS: Mapping[str, Any] = {
    **{name: getattr(USUAL, name) for name in Options.rows()},
    **{"t_eval": None, "verify": False, "initial": None},
}
_SCALE = "scale"


class Named(NamedTuple):
    """What a name stands for."""

    root: str  # "params", "torque", "motion", "t_end" or "option"
    path: Path  # the steps from there, pulleys by index


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
    if root in ("torque", "motion"):
        _check_load(scene, str(name), root, path[1:])
        return Named(root, path[1:])
    if root not in fields(type(scene.params)):
        there = [*known(scene.params), "torque.scale", "motion.scale", "t_end", *OPTIONS]
        raise ValueError(f"nothing is called {name!r}{close_to(str(name), there)}")
    read(scene.params, str(name))
    return Named("params", path)


def place(scene: Scene, name: str) -> Place:
    """Return where a name stands in the layout of a key."""
    root, path = find(scene, name)
    places = [root]
    node: Any = scene.params
    for step in path:
        steps = range(len(node)) if step == "*" else [step]
        places = [
            f"{one}.{k}" if isinstance(k, str) else f"{one}[{k}]" for one in places for k in steps
        ]
        if root == "params":
            node = getattr(node, str(steps[0])) if isinstance(steps[0], str) else node[steps[0]]
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
    scene = scene._replace(params=params, t_end=t_end)
    for root, of_loads in groups.items():
        if root != "params" and of_loads:
            scene = _with_loads(scene, root, of_loads)
    return scene, new_options


def _length_or_preload(changes: list[tuple[Path, Any]]) -> list[tuple[Path, Any]]:
    """Leave out the length of a belt where its preload is given, and the other way round."""
    given = dict(changes)
    for one, other in (("preload", "length"), ("length", "preload")):
        replaced = ("belt", other)
        if given.get(("belt", one)) is not None and replaced not in given:
            return [*changes, (replaced, None)]
    return changes


# --- Loads ----------------------------------------------------------------------------------------


def _loads(scene: Scene, root: str) -> dict[int, Any]:
    """Return the parts of the torque by number, or the motions by pulley."""
    if root == "torque":
        return dict(enumerate(parts_of(scene.torque_fn)))
    motions = as_motions(scene.motion, scene.params.pulley_names)
    return {k: speed_of(one) for k, one in motions.items()}


def _check_load(scene: Scene, name: str, root: str, path: Path) -> None:
    """Refuse the name of a load that is not there."""
    whole = path in ((), (_SCALE,))
    if path == () or (root == "torque" and whole):
        return
    if root == "torque" and not isinstance(scene.torque_fn, Torque):
        raise ValueError(
            f'{name}: the torque is a function: only "torque" and "torque.scale" can be changed'
        )
    loads, names = _loads(scene, root), scene.params.pulley_names
    if not loads:
        raise ValueError(f"{name}: no motion is prescribed in this scene")
    if whole:
        return
    at = path[0]
    if root == "motion" and at not in loads:
        there = ", ".join(f'"motion[{names[k]}]"' for k in loads)
        raise ValueError(f"{name}: motions are called by pulley: {there}")
    if not isinstance(at, int):
        raise ValueError(
            f'{name}: torques are called by number, "torque[0].{at}", or "torque.scale"'
        )
    if at not in loads:
        raise ValueError(f"{name}: the torque has {len(loads)} part(s)")
    if path[1:] != (_SCALE,):
        where = f"torque[{at}]" if root == "torque" else f"motion of {label(at, names)}"
        _look_in(loads[at], name, path[1:], where)


def _look_in(node: Any, name: str, path: Path, where: str) -> None:
    """Go along a path of fields and indices."""
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


def _with_loads(scene: Scene, root: str, changes: list[tuple[Path, Any]]) -> Scene:
    """Change torque or motion: the whole, fields of parts, factors on parts, on all."""
    field = "torque_fn" if root == "torque" else "motion"
    whole = [value for path, value in changes if path == ()]
    if whole:
        scene = scene._replace(**{field: whole[-1]})
        for path, _ in changes:
            _check_load(scene, root, root, path)
    if len(changes) == len(whole):
        return scene
    loads = _loads(scene, root)
    for path, value in sorted(changes, key=_rank):
        if path[-1:] == (_SCALE,):  # of one, or of all
            at = [int(path[0])] if len(path) > 1 else [*loads]
            loads |= {k: _scaled(loads[k], value, root) for k in at}
        elif path:
            loads[int(path[0])] = assign(loads[int(path[0])], [(path[1:], value)])
    if root == "motion":
        return scene._replace(motion=loads)
    return scene._replace(torque_fn=loads[0] if len(loads) == 1 else TorqueSum([*loads.values()]))


def _rank(change: tuple[Path, Any]) -> int:
    path = change[0]
    return (3 if len(path) == 1 else 2) if path and path[-1] == _SCALE else 1


def _scaled(load: Any, factor: object, root: str) -> Any:
    number = real(f"{root}.scale", factor)
    if isinstance(load, CrankMotion):
        return attrs.evolve(load, speed=load.speed * number)
    if isinstance(load, Torque):
        return load * number
    if isinstance(load, Motion):
        return Motion(angle=ScaledFunction(load.angle, number))
    if not callable(load):
        raise ValueError("torque.scale: a compiled function cannot be multiplied by a number")
    return ScaledFunction(load, number)

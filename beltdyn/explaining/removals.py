"""Effects that may be left out of a scene, one at a time.

Numbers that a part may do without, which are those that are 0 by default, come from the tables of
parameters: a new one of this kind appears here by itself. What takes more than a number to leave
out is a row of ``_OTHERS``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import attrs
import numpy as np

from ..drive import cells
from ..drive.balance import tension_held
from ..drive.friction import Dahl, ElasticPlastic, Friction, LuGre, MaxwellSlip
from ..drive.params import Params
from ..drive.scene import Scene
from ..loads.loads import Harmonics
from ..loads.motions import CrankMotion
from ..loads.torques import TorqueLike, TorqueSum, Viscous
from .effects import Part, parts_of

__all__ = ["Removal", "leave_out", "removals_of"]

#: What holds belt or tensioner in place is no effect that could be left out.
_HOLDS = {
    ("arm", "stiffness"),
    ("slider", "stiffness"),
    ("slider", "weight"),
    ("damper", "stiffness"),
    ("contact", "quadratic"),
}
#: Numbers that may be 0 although something is chosen by default.
_CHOSEN = {("contact", "damping")}
#: A Stribeck curve's numbers, the first of them the static coefficient; names of the kinetic one.
_STRIBECK, _KINETIC = ("mu_s", "v_stribeck"), ("mu_k", "mu")


class Removal(NamedTuple):
    """An effect that can be left out.

    Attributes:
        name: Its name.
        how: Change of the scene.
        apply: Returns the scene without it.
    """

    name: str
    how: str
    apply: Callable[[Scene], Scene]


def removals_of(scene: Scene) -> tuple[Removal, ...]:
    """Return the effects that can be left out of a scene."""
    found: dict[tuple[str, str], list[str]] = {}
    for part in parts_of(scene.params):
        for name in _optional(part):
            where = "" if part.pulley is None else scene.params.label(part.pulley)
            found.setdefault((part.path, name), []).append(where)
    numbers = [_number(path, name, where) for (path, name), where in found.items()]
    return (*numbers, *(removal for removal, has in _OTHERS if has(scene)))


def leave_out(scene: Scene, removals: Iterable[Removal]) -> Scene:
    """Return the scene without some effects."""
    for removal in removals:
        scene = removal.apply(scene)
    return scene


# --- numbers of parts -----------------------------------------------------------------------------


def _optional(part: Part) -> Iterator[str]:
    """Name the numbers of a part that are there and need not be."""
    for field in attrs.fields(type(part.part)):  # type: ignore[arg-type]
        rule = field.metadata.get("rule")
        if rule is None or rule.rule != "NONNEGATIVE" or field.name in _STRIBECK:
            continue
        row = (rule.group, rule.name)
        optional = (field.default == 0.0 and row not in _HOLDS) or row in _CHOSEN
        value = getattr(part.part, field.name)
        if optional and isinstance(value, float) and value > 0.0:
            yield field.name


def _number(path: str, name: str, where: list[str]) -> Removal:
    bends = (path, name) == ("belt", "bending_stiffness")

    def apply(scene: Scene) -> Scene:
        return _with_parts(
            scene._replace(params=_of_same_tension(scene.params)) if bends else scene,
            lambda part: {name: 0.0} if part.path == path and name in _optional(part) else {},
        )

    places = ", ".join(place for place in where if place)
    how = f"{path}.{name} = 0" + (f" of {places}" if places else "")
    return Removal(f"{path}.{name}", how + ", at the same tension at rest" * bends, apply)


def _of_same_tension(params: Params) -> Params:
    """Return the tension at rest in place of the length, or of the preload of mounts, that make it.

    A belt that bends is shorter on its way and lifted off its pulleys. Its effect on the tension at
    rest does not count: without bending the belt is still tightened to its tension.
    """
    belt, pulleys, sprung = params.belt, list(params.pulleys), params._moving
    if belt.length is not None and not sprung:
        belt = attrs.evolve(belt, length=None, preload=params.info["mean_tension"])
    elif belt.length is None:
        held = tension_held(params.effective_pulleys, params.gravity, belt.bending_stiffness)
        for _, k, _ in sprung:
            mount: Any = pulleys[k].mount
            drawn = attrs.evolve(mount, preload=None, tension=held, **{mount._row.free: None})
            pulleys[k] = attrs.evolve(pulleys[k], mount=drawn)
    return attrs.evolve(params, belt=belt, pulleys=pulleys)


def _with_parts(scene: Scene, changes: Callable[[Part], dict[str, Any]]) -> Scene:
    """Return the scene with other numbers in some of its parts."""
    params = scene.params
    for part in list(parts_of(params)):
        changed = changes(part)
        if changed:
            old: Any = part.part
            params = _put(params, part, attrs.evolve(old, **changed))
    return scene._replace(params=params)


def _put(params: Params, where: Part, value: Any) -> Params:
    if where.pulley is None:
        return attrs.evolve(params, **{where.path: value})
    pulleys = list(params.pulleys)
    pulleys[where.pulley] = attrs.evolve(pulleys[where.pulley], **{where.path: value})
    return attrs.evolve(params, pulleys=pulleys)


# --- what takes more than a number ----------------------------------------------------------------


def _has_gravity(scene: Scene) -> bool:
    return scene.params.gravity != (0.0, 0.0)


def _without_gravity(scene: Scene) -> Scene:
    return scene._replace(params=attrs.evolve(scene.params, gravity=(0.0, 0.0)))


def _stribeck_off(part: Part) -> dict[str, Any]:
    """Return the static coefficient that takes the Stribeck curve away, where there is one."""
    name, _ = _STRIBECK
    static = getattr(part.part, name, 0.0)
    if part.group != "friction" or static == 0.0:
        return {}
    kinetic = next(getattr(part.part, one) for one in _KINETIC if hasattr(part.part, one))
    total = sum(kinetic) if isinstance(kinetic, tuple) else kinetic
    return {} if static == total else {name: total}


def _has_stribeck(scene: Scene) -> bool:
    return any(_stribeck_off(part) for part in parts_of(scene.params))


def _without_stribeck(scene: Scene) -> Scene:
    return _with_parts(scene, _stribeck_off)


def _coarser_law(part: Part) -> Friction | None:
    """Return the law with one state a link that a law with more states or terms comes close to.

    Dahl's is LuGre's without the dampers, an elastic/plastic one of all elements at once is
    Maxwell slip before the first element slips and after the last (MODEL section 4).
    """
    law = part.part
    curve = {name: getattr(law, name, 0.0) for name in _STRIBECK}
    if isinstance(law, LuGre):
        return Dahl(mu_k=law.mu_k, sigma=law.sigma, **curve)
    if isinstance(law, MaxwellSlip):
        sums = {name: sum(getattr(law, name)) for name in ("mu", "stiffness", "damping")}
        return ElasticPlastic(**sums, **curve)
    return None


def _has_finer_law(scene: Scene) -> bool:
    return any(_coarser_law(part) for part in parts_of(scene.params))


def _without_finer_law(scene: Scene) -> Scene:
    params = scene.params
    for part in list(parts_of(params)):
        if law := _coarser_law(part):
            params = _put(params, part, law)
    return scene._replace(params=params)


def _has_mounts(scene: Scene) -> bool:
    return bool(scene.params._moving)


def _without_mounts(scene: Scene) -> Scene:
    """Fix the axes where they rest, under the belt that is in place."""
    params, centers = scene.params, scene.params.centers()
    pulleys = list(params.pulleys)
    for _, k, _ in params._moving:
        x, y = centers[k]
        pulleys[k] = attrs.evolve(pulleys[k], center=(float(x), float(y)), mount=None)
    fixed = attrs.evolve(params, belt=params.effective_belt, pulleys=pulleys)
    return scene._replace(params=fixed)


def _has_rims(scene: Scene) -> bool:
    return any(pulley.coupling is not None for pulley in scene.params.pulleys)


def _without_couplings(scene: Scene) -> Scene:
    """Make hub and rim, or pulley and ring, one body."""
    pulleys = [
        attrs.evolve(pulley, inertia=pulley.shaft_inertia + pulley.coupled_inertia, coupling=None)
        for pulley in scene.params.pulleys
    ]
    return scene._replace(params=attrs.evolve(scene.params, pulleys=pulleys))


def _has_crank(scene: Scene) -> bool:
    return any(isinstance(motion, CrankMotion) for motion in (scene.motion or {}).values())


def _without_crank(scene: Scene) -> Scene:
    motion = {
        pulley: one.speed if isinstance(one, CrankMotion) else one
        for pulley, one in (scene.motion or {}).items()
    }
    return scene._replace(motion=motion)


def _parts_of_torque(torque: TorqueLike) -> tuple[Any, ...]:
    return torque.parts if isinstance(torque, TorqueSum) else (torque,)


def _has_harmonics(scene: Scene) -> bool:
    return any(isinstance(part, Harmonics) for part in _parts_of_torque(scene.torque_fn))


def _without_harmonics(scene: Scene) -> Scene:
    parts = [p for p in _parts_of_torque(scene.torque_fn) if not isinstance(p, Harmonics)]
    nothing = Viscous(np.zeros(len(scene.params.pulleys)))
    return scene._replace(torque_fn=TorqueSum(tuple(parts) or (nothing,)))


def _has_landings(scene: Scene) -> bool:
    return cells.instead(scene.params) is not None


def _without_landings(scene: Scene) -> Scene:
    params = cells.instead(scene.params)
    return scene if params is None else scene._replace(params=params)


#: What can be left out besides numbers, and which scenes have it. Mounts come last: where their
#: pulleys rest depends on what else is left out.
_OTHERS: tuple[tuple[Removal, Callable[[Scene], bool]], ...] = (
    (Removal("gravity", "gravity = (0, 0)", _without_gravity), _has_gravity),
    (
        Removal("Stribeck curve", "friction.mu_s as the kinetic coefficient", _without_stribeck),
        _has_stribeck,
    ),
    (
        Removal(
            "finer friction law",
            "friction = Dahl for LuGre, ElasticPlastic for MaxwellSlip",
            _without_finer_law,
        ),
        _has_finer_law,
    ),
    (
        Removal("harmonics of the crank", "the mean speed as its motion", _without_crank),
        _has_crank,
    ),
    (
        Removal("harmonics of torques", "no Harmonics among the torques", _without_harmonics),
        _has_harmonics,
    ),
    (
        Removal("couplings of shafts", "coupling = None, hub and rim one body", _without_couplings),
        _has_rims,
    ),
    (
        Removal("landing links", 'belt.mesh = "ale", n_bodies = None', _without_landings),
        _has_landings,
    ),
    (
        Removal("motion of mounts", "mount = None, fixed where the belt rests", _without_mounts),
        _has_mounts,
    ),
)

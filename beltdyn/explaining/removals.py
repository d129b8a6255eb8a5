"""Effects that may be left out of a scene, one at a time.

Numbers that a part may do without, which are those that are 0 by default, come from the tables of
parameters: a new one of this kind appears here by itself. What takes more than a number to leave
out is a row of ``_OTHERS``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import attrs
import numpy as np

from ..drive import cells
from ..drive.balance import tension_held
from ..drive.friction import Dahl, ElasticPlastic, Friction, LuGre, MaxwellSlip
from ..drive.mounts import KINDS
from ..drive.parameters import Path, assign
from ..drive.params import Params
from ..drive.scene import Scene
from ..loads.loads import Harmonics
from ..loads.motions import CrankMotion
from ..loads.torques import TorqueSum, Viscous
from ..many.outcome import attempt
from ..result.errors import SimulationError
from .effects import Part, parts_of

#: What holds belt or tensioner in place is no effect that could be left out.
_HOLDS = {
    *((kind, name) for kind in KINDS for name in ("stiffness", "weight")),
    ("damper", "stiffness"),
    ("contact", "quadratic"),
}
#: Numbers that may be 0 although something is chosen by default.
_CHOSEN = {("contact", "damping")}
#: A Stribeck curve's numbers, the first of them the static coefficient; names of the kinetic one.
_STRIBECK, _KINETIC = ("mu_s", "v_stribeck"), ("mu_k", "mu")


class Removal(NamedTuple):
    """An effect that can be left out: its name, how the scene is changed, the scene without it."""

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
    return (*numbers, *(removal for removal in _OTHERS if _changes(removal, scene)))


def _changes(removal: Removal, scene: Scene) -> bool:
    """Whether a scene has an effect, one that it cannot do without too."""
    return attempt(lambda: removal.apply(scene), (SimulationError, ValueError)).value is not scene


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
        def without(part: Part) -> Any:
            there = part.path == path and name in _optional(part)
            return attrs.evolve(cast(Any, part.part), **{name: 0.0}) if there else None

        same = scene._replace(params=_of_same_tension(scene.params)) if bends else scene
        return _with_parts(same, without)

    places = ", ".join(place for place in where if place)
    how = f"{path}.{name} = 0" + (f" of {places}" if places else "")
    return Removal(f"{path}.{name}", how + ", at the same tension at rest" * bends, apply)


def _of_same_tension(params: Params) -> Params:
    """Return the drive given by its tension at rest, not by the length or preload of mounts."""
    # Bending shortens the belt on its way and lifts it off its pulleys. Without it the belt would
    # still be tightened to its tension, so that effect is not one of bending.
    belt, sprung = params.belt, params._moving
    if belt.length is not None:
        at_rest = attrs.evolve(belt, length=None, preload=params.info["mean_tension"])
        return params if sprung else attrs.evolve(params, belt=at_rest)
    held = tension_held(params.effective_pulleys, params.gravity, belt.bending_stiffness)
    changes: list[tuple[Path, Any]] = []
    for _, k, _ in sprung:
        mount: Any = params.pulleys[k].mount
        drawn = attrs.evolve(mount, preload=None, tension=held, **{mount._row.free: None})
        changes.append((("pulleys", k, "mount"), drawn))
    kept: Params = assign(params, changes)
    return kept


def _with_parts(scene: Scene, changed: Callable[[Part], Any]) -> Scene:
    """Return the scene with other parts in place of some, for which ``changed`` is not None."""
    new = [(part, changed(part)) for part in parts_of(scene.params)]
    return _with(scene, [(part.place, one) for part, one in new if one is not None])


def _with(scene: Scene, changes: Sequence[tuple[Path, Any]]) -> Scene:
    """Return the scene with other values in its drive, the same one where there are none."""
    return scene._replace(params=assign(scene.params, changes)) if changes else scene


# --- what takes more than a number: the same scene where it is not there --------------------------


def _without_gravity(scene: Scene) -> Scene:
    return _with(scene, [(("gravity",), (0.0, 0.0))] if any(scene.params.gravity) else [])


def _without_curve(part: Part) -> Any:
    """Return a law with the static coefficient that takes its Stribeck curve away."""
    name, _ = _STRIBECK
    static = getattr(part.part, name, 0.0)
    if part.group != "friction" or static == 0.0:
        return None
    kinetic = next(getattr(part.part, one) for one in _KINETIC if hasattr(part.part, one))
    total = sum(kinetic) if isinstance(kinetic, tuple) else kinetic
    return None if static == total else attrs.evolve(cast(Any, part.part), **{name: total})


def _coarser_law(part: Part) -> Friction | None:
    """Return the simpler law that LuGre or Maxwell slip comes close to; None for other laws."""
    # Dahl's is LuGre's without the dampers; one elastic/plastic element is Maxwell slip before the
    # first element slips and after the last (MODEL section 4).
    law = part.part
    curve = {name: getattr(law, name, 0.0) for name in _STRIBECK}
    if isinstance(law, LuGre):
        return Dahl(mu_k=law.mu_k, sigma=law.sigma, **curve)
    if isinstance(law, MaxwellSlip):
        sums = {name: sum(getattr(law, name)) for name in ("mu", "stiffness", "damping")}
        return ElasticPlastic(**sums, **curve)
    return None


def _without_mounts(scene: Scene) -> Scene:
    """Fix the axes where they rest, under the belt that is in place."""
    params, changes = scene.params, list[tuple[Path, Any]]()
    for _, k, _ in params._moving:
        x, y = params.centers()[k]
        changes.append((("pulleys", k, "center"), (float(x), float(y))))
        changes.append((("pulleys", k, "mount"), None))
    return _with(scene, [*changes, (("belt",), params.effective_belt)] if changes else [])


def _without_couplings(scene: Scene) -> Scene:
    """Make hub and rim, or pulley and ring, one body."""
    changes: list[tuple[Path, Any]] = []
    for k, pulley in enumerate(scene.params.pulleys):
        if pulley.coupling is not None:
            whole = pulley.shaft_inertia + pulley.coupled_inertia
            changes += [(("pulleys", k, "inertia"), whole), (("pulleys", k, "coupling"), None)]
    return _with(scene, changes)


def _without_crank(scene: Scene) -> Scene:
    motion = dict(scene.motion or {})
    steady = {k: one.speed for k, one in motion.items() if isinstance(one, CrankMotion)}
    return scene._replace(motion=motion | steady) if steady else scene


def _without_harmonics(scene: Scene) -> Scene:
    torque: Any = scene.torque_fn
    parts = torque.parts if isinstance(torque, TorqueSum) else (torque,)
    others = tuple(part for part in parts if not isinstance(part, Harmonics))
    if len(others) == len(parts):
        return scene
    nothing = Viscous(np.zeros(len(scene.params.pulleys)))
    return scene._replace(torque_fn=TorqueSum(others or (nothing,)))


def _without_landings(scene: Scene) -> Scene:
    instead = cells.instead(scene.params)
    return scene if instead is None else scene._replace(params=instead)


#: What can be left out besides numbers. Mounts come last: where their pulleys rest depends on what
#: else is left out.
_OTHERS = (
    Removal("gravity", "gravity = (0, 0)", _without_gravity),
    Removal(
        "Stribeck curve",
        "friction.mu_s as the kinetic coefficient",
        lambda scene: _with_parts(scene, _without_curve),
    ),
    Removal(
        "finer friction law",
        "friction = Dahl for LuGre, ElasticPlastic for MaxwellSlip",
        lambda scene: _with_parts(scene, _coarser_law),
    ),
    Removal("harmonics of the crank", "the mean speed as its motion", _without_crank),
    Removal("harmonics of torques", "no Harmonics among the torques", _without_harmonics),
    Removal("couplings of shafts", "coupling = None, hub and rim one body", _without_couplings),
    Removal("landing links", 'belt.mesh = "ale", n_bodies = None', _without_landings),
    Removal("motion of mounts", "mount = None, fixed where the belt rests", _without_mounts),
)

"""From beltdyn's objects to the oracle's, for the tests that hold one against the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import ale_reference
import attrs
import numpy as np
import reference
import reference_mounts
from laws import oracle_law
from reference_string import String

import beltdyn as bd
from beltdyn import _core

STATE = {"t", *(name for name, *_ in _core.STATE_FIELDS)}


def oracle_of(params: bd.Params) -> reference.Reference:
    """The same drive as the oracle wants it, built from the user's numbers alone."""
    belt, contact = params.belt, params.effective_contact
    of_belt = {"links": reference.Reference, "string": String}[params.belt_model]
    return of_belt(
        length=params.effective_belt.length,
        n_bodies=belt.n_bodies,
        linear_density=belt.linear_density,
        axial_stiffness=belt.axial_stiffness,
        axial_damping=belt.axial_damping,
        bending_stiffness=belt.bending_stiffness,
        bending_damping=belt.bending_damping,
        centers=np.array([p.center for p in params.pulleys]),
        radii=np.array([p.radius for p in params.pulleys]),
        inertias=np.array([p.inertia for p in params.pulleys]),
        contact=(contact.quadratic, contact.linear, contact.damping),
        hunt_crossley=contact.hunt_crossley,
        gravity=params.gravity,
        winding=winding_of(params),
        drag=drag_of(params),
        mesh=belt.mesh,
        sides=sides_of(params),
        compensate=contact.compensate,
        mounts=mounts_of(params),
        **friction_of(params),
    )


def friction_of(params: bd.Params) -> dict[str, Any]:
    """The law of each pulley; one Dahl law of all in the way that the oracle computes faster."""
    laws = [params.friction_on(k) for k in range(len(params.pulleys))]
    first = laws[0]
    if isinstance(first, bd.Dahl) and not first.mu_s and all(law == first for law in laws):
        return {"mu_k": first.mu_k, "sigma": first.sigma}
    return {"friction": tuple(oracle_law(law) for law in laws)}


def drag_of(params: bd.Params) -> np.ndarray | None:
    """Coefficients of every pulley's drag, None if no pulley has any."""
    drags = [pulley.drag for pulley in params.pulleys]
    if not any(drags):
        return None
    return np.array([(d.coulomb, d.viscous, d.quadratic) if d else (0, 0, 0) for d in drags])


def mounts_of(params: bd.Params) -> dict[int, reference_mounts.Mount]:
    """Mounts by pulley, from the user's numbers; what is None there is chosen by the oracle."""
    found: dict[int, reference_mounts.Mount] = {}
    for j, pulley in enumerate(params.pulleys):
        mount = getattr(pulley, "mount", None)
        if mount is None:
            continue
        mount = params.effective_pulleys[j].mount
        given = attrs.asdict(mount, recurse=False)
        given.pop("tension", None)
        unloaded = given.pop("free_angle", None), given.pop("free_travel", None)
        for at in unloaded:
            if at is not None:
                given["preload"] = mount.stiffness * at
        if "preload" in given and given["preload"] is None:
            given["preload"] = 0.0
        found[j] = getattr(reference_mounts, type(mount).__name__)(**given)
    return found


def sides_of(params: bd.Params) -> tuple[int, ...]:
    """+1 of pulleys inside the loop, -1 of those outside."""
    return tuple(1 if pulley.side == "inside" else -1 for pulley in params.pulleys)


def winding_of(params: bd.Params) -> int:
    """Turns of the belt round its loop, from the order and the sides of the pulleys."""
    if len(params.pulleys) == 1:
        return -1
    centers = [pulley.center for pulley in params.pulleys]
    radii = [pulley.radius for pulley in params.pulleys]
    belt = params.belt
    return reference.belt_line(
        centers, radii, params.effective_belt.length, belt.n_bodies, sides_of(params)
    )[3]


def fields(state: bd.State) -> dict[str, Any]:
    """A state as the plain dict that the oracle and the binding take."""
    return {
        name: value for name, value in attrs.asdict(state, recurse=False).items() if name in STATE
    }


def ale_oracle_of(params: bd.Params, **changes: Any) -> ale_reference.Ale:
    """The same drive with an ALE belt as its oracle wants it."""
    belt, contact = params.belt, params.effective_contact
    data: dict[str, Any] = {
        "length": params.effective_belt.length,
        "linear_density": belt.linear_density,
        "axial_stiffness": belt.axial_stiffness,
        "axial_damping": belt.axial_damping,
        "bending_stiffness": belt.bending_stiffness,
        "bending_damping": belt.bending_damping,
        "centers": np.array([p.center for p in params.pulleys]),
        "radii": np.array([p.radius for p in params.pulleys]),
        "inertias": np.array([p.inertia for p in params.pulleys]),
        "contact": (contact.quadratic, contact.linear),
        "contact_damping": (contact.damping, contact.hunt_crossley),
        "friction": tuple(oracle_law(params.friction_on(k)) for k in range(len(params.pulleys))),
        "sides": sides_of(params),
        "compensate": contact.compensate,
        "gravity": params.gravity,
        "drag": drag_of(params),
        "mounts": mounts_of(params),
    }
    return ale_reference.Ale(**(data | changes))


def on_mesh_of(params: bd.Params, **changes: Any) -> ale_reference.Ale:
    """That oracle with the cells of the core's belt."""
    small = ale_reference.Ale.small
    arcs = float(params.route.wraps @ [max(pulley.radius, small) for pulley in params.pulleys])
    cell = arcs / (params.belt.n_bodies - 2 * len(params.pulleys))
    n_modes = int(params.info["n_modes"]) // len(params.pulleys)
    model = ale_oracle_of(params, cell=cell, n_modes=n_modes, **changes)
    assert model.n == params.info["n_bodies"]
    return model


#: Of an ALE belt what its oracle calls otherwise than the core's state.
_ALE_NAMES = {"travel": "q", "travel_speed": "dq", "mount_friction": "zeta"}


def ale_vector(model: ale_reference.Ale, state: Mapping[str, Any]) -> np.ndarray:
    """A state of the core, or rates, as the oracle has it, whose works stay 0."""
    same = ("m", "v", "a", "p", "along", "along_speed", "theta", "omega")
    parts = {name: state[name] for name in same}
    places = list(model.mounts)
    for name, own in _ALE_NAMES.items():
        if model.n_m:
            parts[own] = np.asarray(state[name])[[places.index(j) for j in model.sprung]]
    z = np.reshape(state["mu"], (-1, model.n))
    if z.size:
        z = z.reshape(2, -1, model.n)[:, : model.n_z, model.arcs]
        parts["z"] = np.asarray(z.swapaxes(0, 1))
    shaped = {name: np.reshape(part, model.layout[name][1]) for name, part in parts.items()}
    return model.pack(**shaped)

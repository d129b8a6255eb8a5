"""Where power comes from and goes to, from the energy ledger and the powers of the pulleys."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _core
from ..base.rounding import percent
from ..drive import sanity
from ..outputs.arcs import per_pulley
from ..outputs.selection import named
from .digits import number
from .rows import RESIDUAL, Power, Rows
from .window import Touching, Window

#: Work of the belt on axes that are led along a path, put in or taken off by what leads them; and
#: what that is called.
_PATH, PATHS = "path_work", "axes that follow a path"
_LOSSES = {
    "joint_loss": "damping of the belt",
    "contact_loss": "damping in the contact",
    "friction_loss": "friction on the pulleys",
    "drag_loss": "bearing drag",
    "mount_loss": "dampers and friction of mounts",
    "coupling_loss": "dampers of couplings",
}
#: Share of what is put in by which what is stored may change for an efficiency to mean something.
STORED = 0.01


def power_rows(window: Window) -> dict[str, Any]:
    """Return the rows, the efficiency and its error by their names; note what is missing.

    Losses and the change of what is stored are differences of the ledger over the window, exact but
    for its residual. Powers of pulleys are means of samples; "error of sampling" is what their sum
    lacks of the ledger's work. Of friction the same, by pulley.

    Axes that follow a path put power in or take it off as pulleys do. Dry friction of mounts stores
    what bends its bristles, F^2 / (2 k): that is stored, not lost.
    """
    run, names, notes = window.run, window.params.pulley_names, window.notes
    energy, lasts = run.energy if run._has("energy") else None, window.lasts
    if not run._has("energy"):
        notes.append("no powers: energy not asked for (outputs of simulate)")
    elif energy is None:
        notes.append("no powers: the run has no energy ledger (ledger=False)")
    elif not (run._has("pulleys.omega") and run._has("pulleys.torque")):
        notes.append("no powers: pulleys.omega or pulleys.torque not asked for")
    if energy is None or window.missing(named(pulleys="omega torque")):
        return {"powers": Rows(), "efficiency": None, "efficiency_error": None}

    def rate(history: np.ndarray | None) -> float:
        if history is None:
            return 0.0
        part = window.of(history)
        return float(part[-1] - part[0]) / lasts

    bristles = _bristles(window)
    if bristles is None and energy.mount_loss is not None:
        notes.append(
            "what dry friction of mounts stores is counted as lost: mounts.friction_force not "
            "asked for (outputs of simulate)"
        )
    powers = window.mean(window.of(run.pulleys.torque) * window.of(run.pulleys.omega))
    scale = float(np.max(np.abs(powers), initial=0.0))
    given = [k for k, power in enumerate(powers) if power > 1e-9 * scale]
    taken = [k for k, power in enumerate(powers) if power < -1e-9 * scale]
    path = rate(getattr(energy, _PATH, None))
    put_in = float(sum(powers[k] for k in given)) + max(0.0, -path)
    rows: list[tuple[str, str, float]] = [(names[k], "in", float(powers[k])) for k in given]
    rows += [(names[k], "out", -float(powers[k])) for k in taken]
    if path != 0.0:
        rows.append((PATHS, "in" if path < 0.0 else "out", abs(path)))
    lost, held = 0.0, rate(bristles)
    for term, text in _LOSSES.items():
        history = getattr(energy, term, None)
        if history is None:
            continue
        power = rate(history) - (held if term == "mount_loss" else 0.0)
        lost += power
        if term == "friction_loss" and window.touching and window.params.has_friction:
            rows += _friction(window, window.touching, power)
        else:
            rows.append((text, "lost", power))
    known = {name for name, kind, _ in _core.ENERGY_TERMS if kind == "LOST"}
    assert known <= {*_LOSSES, _PATH}, "a loss of the ledger has no text"
    stored = rate(energy.total) + held
    rows.append(("change of what is stored", "stored", stored))
    rows.append(("error of sampling", "left", float(np.sum(powers)) - rate(energy.drive)))
    rows.append((RESIDUAL, "left", -rate(energy.residual)))
    efficiency = error = None
    if not put_in > 0.0:
        notes.append("no efficiency: no pulley puts power in, in this window")
    elif abs(stored) > STORED * put_in:
        notes.append(
            f"no efficiency: what is stored changes by {number(abs(stored), 2)} W in this window, "
            f"{percent(abs(stored) / put_in)} of what is put in"
        )
    elif not (taken or path > 0.0):
        notes.append("no efficiency: no pulley takes power off, in this window")
    else:
        efficiency = 1.0 - lost / put_in
    if put_in > 0.0:
        error = _error(window, put_in, rate(energy.contact_loss), rate(energy.friction_loss))
    found = [
        Power(name=name, kind=kind, power=power, share=power / put_in if put_in > 0.0 else None)
        for name, kind, power in rows
    ]
    return {"powers": Rows(found), "efficiency": efficiency, "efficiency_error": error}


def _error(window: Window, put_in: float, contact: float, friction: float) -> float:
    """Return the error of the efficiency, measured or from losses in contact and friction."""
    run, measured = window.run, window.run.accuracy["power"].total
    lost = sanity.mesh_loss(window.params, contact, friction)
    if run.accuracy.verified and measured is not None:
        lost = measured * float(np.max(np.abs(run.pulleys.torque * run.pulleys.omega)))
    return lost / put_in


def _bristles(window: Window) -> np.ndarray | None:
    """Return the energy stored by dry friction of mounts (n_t,) [J]; None: none, or not known."""
    run, params = window.run, window.params
    stored: np.ndarray = np.zeros(run.t.size)
    for m, _, mount in params._moving:
        if not mount.friction > 0.0:
            continue
        if run.mounts is None or not run._has("mounts.friction_force"):
            return None
        stiffness = params._model.mounts[m]["friction_stiffness"]
        stored = stored + run.mounts.friction_force[:, m] ** 2 / (2.0 * stiffness)
    return stored


def _friction(window: Window, touching: Touching, whole: float) -> list[tuple[str, str, float]]:
    """Split the loss to friction by pulley: F v summed over the samples."""
    names, velocity = window.params.pulley_names, window.of(window.run.contact.velocity)
    split = window.mean(per_pulley(touching.friction * velocity, touching.pulley, len(names)))
    rows = [(f"friction on {name}", "lost", float(split[k])) for k, name in enumerate(names)]
    return [*rows, ("friction, error of sampling", "lost", whole - float(sum(split)))]

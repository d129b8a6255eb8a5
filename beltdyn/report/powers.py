"""Where power comes from and goes to, from the energy ledger and the powers of the pulleys."""

from __future__ import annotations

import numpy as np

from .. import _core
from .rows import Power
from .touching import Touching
from .window import Window

__all__ = ["power_rows"]

_LOSSES = {
    "joint_loss": "damping in the belt's joints",
    "contact_loss": "damping in the contact",
    "friction_loss": "friction on the pulleys",
    "drag_loss": "bearing drag",
    "mount_loss": "dampers and friction of mounts",
    "path_work": "work on axes that follow a path",
}


def power_rows(
    window: Window, touching: Touching | None
) -> tuple[list[Power], float | None, list[str]]:
    """Give the rows, the efficiency and what is missing.

    Losses and the change of what is stored are differences of the ledger over the window, exact but
    for its residual. Powers of pulleys are means of samples; "error of sampling" is what their sum
    lacks of the ledger's work. Of friction the same, by pulley.

    Returns:
        Rows whose sizes add up: what is put in is the sum of all others. Efficiency: the part that
        is not lost, None if nothing is put in.
    """
    run, names = window.run, window.params.pulley_names
    if not run._has("energy"):
        return [], None, ["no powers: energy not asked for (outputs of simulate)"]
    if run.energy is None:
        return [], None, ["no powers: the run has no energy ledger (ledger=False)"]
    if not (run._has("pulleys.omega") and run._has("pulleys.torque")):
        return [], None, ["no powers: pulleys.omega or pulleys.torque not asked for"]
    energy, lasts = run.energy, window.lasts

    def rate(history: np.ndarray | None) -> float:
        if history is None:
            return 0.0
        part = window.of(history)
        return float(part[-1] - part[0]) / lasts

    powers = window.mean(window.of(run.pulleys.torque) * window.of(run.pulleys.omega))
    scale = float(np.max(np.abs(powers), initial=0.0))
    given = [k for k, power in enumerate(powers) if power > 1e-9 * scale]
    taken = [k for k, power in enumerate(powers) if power < -1e-9 * scale]
    put_in = float(sum(powers[k] for k in given))

    rows: list[tuple[str, str, float]] = [(names[k], "in", float(powers[k])) for k in given]
    rows += [(names[k], "out", -float(powers[k])) for k in taken]
    lost = 0.0
    for term, text in _LOSSES.items():
        if getattr(energy, term, None) is None:
            continue
        power = rate(getattr(energy, term))
        lost += power
        if term == "friction_loss" and touching is not None and window.params.has_friction:
            rows += _friction(window, touching, power)
        else:
            rows.append((text, "lost", power))
    known = {name for name, kind, _ in _core.ENERGY_TERMS if kind == "LOST"}
    assert known <= set(_LOSSES), "a loss of the ledger has no text"
    rows.append(("change of what is stored", "stored", rate(energy.total)))
    rows.append(("error of sampling", "left", float(np.sum(powers)) - rate(energy.drive)))
    rows.append(("not accounted for (residual)", "left", -rate(energy.residual)))
    efficiency = 1.0 - lost / put_in if put_in > 0.0 else None
    notes = [] if put_in > 0.0 else ["no efficiency: no pulley puts power in, in this window"]
    return (
        [
            Power(name=n, kind=k, power=p, share=p / put_in if put_in > 0.0 else None)
            for n, k, p in rows
        ],
        efficiency,
        notes,
    )


def _friction(window: Window, touching: Touching, whole: float) -> list[tuple[str, str, float]]:
    """Split the loss to friction by pulley: F v summed over the samples."""
    contact = window.run.contact
    lost = window.of(contact.friction) * window.of(contact.velocity)
    rows, split = [], 0.0
    for k, name in enumerate(window.params.pulley_names):
        power = float(window.mean(np.sum(np.where(touching.pulley == k, lost, 0.0), axis=1)))
        split += power
        rows.append((f"friction on {name}", "lost", power))
    return [*rows, ("friction, error of sampling", "lost", whole - split)]

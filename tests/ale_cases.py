"""Cases of the flowing belt's oracle as numbers in text, for tests/c/test_ale.c.

`python tests/ale_cases.py FOLDER` reads the .npz of a folder, each a drive with states and rates as
`ale_reference.py` has them, and writes one stream: a name, how many numbers, the numbers (to the
last bit). A drive begins with its name as `case NAME`.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import reference_mounts

LAWS = (
    "Dahl", "LuGre", "ElasticPlastic", "Coulomb", "CreepRate", "Threlfall", "MaxwellSlip",
)  # fmt: skip
"""In the order of the core's table."""

DRIVE = (
    "n_p", "n", "K", "sense", "sides", "radii", "length", "rhoA", "EA", "etaA", "EI", "etaI",
    "contact", "gravity", "h_0", "p_0", "on", "EI_n", "inertias", "x_table_h", "x_table",
)  # fmt: skip
STATE = (
    "m", "v", "z", "a", "p", "omega", "d_m", "d_v", "d_z", "d_a", "d_p", "torque_of_belt", "W",
    "ax_tension", "ax_flow", "ax_pressing", "geo_span", "geo_wrap",
    "geo_axis", "geo_lever", "geo_known", "d_works",
    "E_elastic", "E_contact", "E_bending", "E_kinetic", "E_lateral",
)  # fmt: skip


def put(name: str, values: Any) -> None:
    flat = np.asarray(values, dtype=float).ravel()
    print(name, len(flat), *(float(x).hex() for x in flat))


def law_numbers(law: tuple[str, dict[str, Any]] | None) -> list[float]:
    """Number of the law, 0 without one, and its parameters; of lists, their length before them."""
    if law is None:
        return [0.0]
    found = [1.0 + LAWS.index(law[0])]
    for value in law[1].values():
        found += [len(value), *value] if isinstance(value, tuple) else [value]
    return found


def bearing(data: Any, j: int, omega: float) -> float:
    coulomb, viscous, quadratic = data["drag"][j]
    smooth = omega / np.hypot(omega, data["omega_0"][j]) if coulomb else 0.0
    return float(coulomb * smooth + viscous * omega + quadratic * omega * abs(omega))


def put_case(path: Path) -> None:
    data = np.load(path)
    known = {"np": np, "inf": np.inf, "array": np.array}
    laws = eval(str(data["friction"]), known)  # noqa: S307  (written by the oracle's own script)
    text = re.sub(r", 'spline': <[^>]*>", "", str(data["mounts"]))
    given = eval(text, known)  # noqa: S307
    mounts = {j: getattr(reference_mounts, kind)(**numbers) for j, (kind, numbers) in given.items()}
    sprung = [j for j, one in mounts.items() if isinstance(one, reference_mounts.Sprung)]
    put(f"case {path.stem}", [len(data["m"]), len(sprung), int(bool(mounts))])
    for name in DRIVE:
        put(name, data[name])
    put("sprung", sprung)
    rest = np.array(data["centers"], dtype=float)
    for i, j in enumerate(sprung):
        rest[j] = mounts[j].place(data["q_0"][i], rest[j])
    for j in mounts.keys() - set(sprung):
        rest[j] = mounts[j].place(0.0, rest[j])
    put("centers", rest)
    for law in laws:
        put("law", law_numbers(law))
    for k in range(len(data["m"])):
        for name in STATE:
            put(name, data[name][k])
        places = np.array(data["centers"], dtype=float)
        for j in mounts.keys() - set(sprung):
            places[j] = rest[j]
        bend, speed = np.zeros((len(places), 2)), np.zeros(len(places))
        matrix, load = np.zeros((len(sprung), len(sprung))), np.zeros(len(sprung))
        for i, j in enumerate(sprung):
            one, q, dq, zeta = mounts[j], data["q"][k, i], data["dq"][k, i], data["zeta"][k, i]
            places[j] = one.place(q, data["centers"][j])
            own = one.spring(q) + one.damper(dq) - one.friction * zeta + one.stop(q, dq)
            own = own + one.weighs * (one.lever(q, data["centers"][j]) @ data["gravity"])
            speed[j] = dq
            if one.carries_bearing:
                lever = one.lever(q, data["centers"][j])
                bend[j] = -lever[1], lever[0]
                own = own + bearing(data, j, data["omega"][k, j] - dq)
            matrix[i, i] = one.moved
            load[i] = own
        put("places", places)
        put("bend", bend)
        put("speed", speed)
        if sprung:
            put("mount_matrix", data["mount_matrix"][k] - matrix)
            put("mount_load", data["mount_load"][k] - load)
            put("mount_scale", np.abs(data["mount_load"][k]) + np.abs(load))


def main() -> None:
    for path in sorted(Path(sys.argv[1]).glob("*.npz")):
        put_case(path)
    print("end 0")


if __name__ == "__main__":
    main()

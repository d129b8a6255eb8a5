"""Scenes that others have published, with their results, to compare with."""

from __future__ import annotations

from ..drive.scene import Scene
from .from_file import kept

__all__ = ["ntarladima_2023"]


def ntarladima_2023(n_bodies: int = 240) -> Scene:
    """Run the two-pulley benchmark of Ntarladima et al. up to 12 rad/s, then load it.

    Two pulleys of radius 0.1 m, 0.1 pi m apart, turn counter-clockwise, with gravity. From a
    preload of 400 N without friction, at rest, pulley 0 is brought to 12 rad/s between 0.05 and
    0.60 s; pulley 1 has a drag of 2 N m s/rad and, from 1 to 1.5 s, a load that rises to 25 N m.
    The upper span is the tight one, ``span_tension[:, 0]``.

    The article gives everything per metre of the reference length 0.4 pi m, the belt line, to which
    the belt is stretched by a twentieth: its tension is 8000 N (e + 0.05), with the strain e of
    that length. Here all is per metre of the stress-free length 0.38 pi m, so that EA is 7600 N.
    The belt is 0.08 m wide; contact and friction are given per area. The load, 12.5 N m (1 -
    cos(2 pi (t - 1))), is a harmonic of the angle of pulley 0, which is 12 (t - 0.325) rad by then.

    At 2.45 s, mean of the last 0.05 s, 240 links give 11.306 rad/s of pulley 1, spans of 664.4 and
    186.4 N and a driving torque of 47.64 N m. Quasi-static creep theory without gravity has 11.308
    rad/s, 663.2 and 186.9 N, 47.62 N m; the authors' finest run, of 480 ANCF elements, 11.325
    rad/s, 664.5 and 186.3 N, 47.65 N m.

    Source: K. Ntarladima, M. Pieber, J. Gerstmayr, "A model for contact and friction between beams
    under large deformation and sheaves", Nonlinear Dynamics (2023), doi:10.1007/s11071-023-08973-y.

    Args:
        n_bodies: Number of links.
    """
    return kept("ntarladima_2023", n_bodies)

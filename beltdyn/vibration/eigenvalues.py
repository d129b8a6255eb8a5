"""Eigenvalues of the linearised drive, all within a band of frequencies.

Friction that sticks makes an eigenvalue of 0 for each link in contact, contact and damping fast
real ones in clusters. Searched are discs round i w of the radius 0.98 w, in which there are
neither: all modes of small damping between 0.02 w and 1.98 w, of a quarter of critical damping up
to 1.9 w.

In a disc by block Arnoldi for (J - i w)^-1 with a sparse LU, without restarts: an eigenvalue that
many vectors share is one point to a Krylov space, where ARPACK, which restarts, would have to find
every one of them before what it is asked for. Three random vectors at once find pairs of equal
spans; multiplied by J they have nothing of the zeros. A disc is done when every Ritz value in it
has converged and half as many vectors again bring no other. That is no proof that none is missing:
tests compare with all eigenvalues of the dense matrix, and count.py counts them.

What grows without oscillating, or hardly oscillating, lies nearer to the positive real axis than
that sees, by some 12 degrees. Searched for it are discs round real shifts s of the radius 0.9 s,
between them all that lies within 64 degrees of the axis, from the slowest rate of the band to its
end. Friction, contact and dampers, of which the clusters are made, lie at 0 and on the other side.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..drive.params import Params
from .linearised import Complex, Linear, scipy_sparse
from .participation import steady_share

#: Of a disc, against the distance of its centre from 0; and of the disc for real eigenvalues.
RADIUS, DECAYS = 0.98, 0.95
#: Vectors at once; blocks at first; and most vectors of a space.
BLOCK, BLOCKS, MOST = 3, 20, 600
#: Error of a Ritz value against its distance from the shift, which counts as converged.
CONVERGED = 1e-10
#: The lower disc against the first; the next against the last.
LOWER, NEXT = 0.05, 1.6
#: Eigenvalues of two discs that are one, against the rate.
SAME = 1e-6
#: The same of discs on the real axis: radius, the next against the last.
GROWING, NEXT_GROWING = 0.9, 12.0
#: Share of the kinetic energy of a mode that is in its mean over the phases of the mesh, below
#: which it is another one's with the passing of the links added.
STEADY = 0.5


class Found(NamedTuple):
    """Eigenvalues (n,), their vectors (size, n)."""

    values: Complex
    vectors: Complex

    def of(self, which: Any) -> Found:
        """Return some of them."""
        return Found(self.values[which], self.vectors[:, which])


def first_rate(params: Params) -> float:
    """Estimate the lowest rate of the spans as strings [rad/s]."""
    return float(np.pi * params._wave_speed / np.max(params.route.spans))


def disc(linear: Linear, shift: complex, radius: float) -> tuple[Found, bool]:
    """Return the eigenvalues in the disc round a shift that have converged; whether that is all."""
    sparse, linalg = scipy_sparse()
    size, matrix = linear.scaled(abs(shift))  # unknowns in sizes of that angular frequency
    lu = linalg.splu((matrix - shift * sparse.identity(linear.size, format="csc")).tocsc())
    start = np.random.default_rng(1).standard_normal((linear.size, BLOCK)).astype(complex)
    space, h = [np.linalg.qr(matrix @ lu.solve(start))[0]], np.zeros((MOST + BLOCK, MOST), complex)

    def grow(blocks: int) -> tuple[Found, bool]:
        """Add blocks, each orthogonal to all before (Gram and Schmidt, twice); return as above."""
        for m in range(BLOCK * len(space), BLOCK * (len(space) + blocks), BLOCK):
            basis, new = np.hstack(space), lu.solve(space[-1])
            for _ in range(2):
                share = basis.conj().T @ new
                new -= basis @ share
                h[:m, m - BLOCK : m] += share
            q, h[m : m + BLOCK, m - BLOCK : m] = np.linalg.qr(new)
            space.append(q)
        theta, y = np.linalg.eig(h[:m, :m])
        near = np.flatnonzero(abs(theta) * radius > 1.0)
        theta, y = theta[near], y[:, near]
        off = np.linalg.norm(h[m : m + BLOCK, m - BLOCK : m] @ y[-BLOCK:], axis=0)
        good = off < CONVERGED * abs(theta)
        vectors = size[:, None] * (np.hstack(space[:-1]) @ y[:, good])
        return Found(shift + 1.0 / theta[good], vectors), bool(good.all())

    most = min(MOST, linear.size) // BLOCK - 1
    blocks = min(BLOCKS, most)
    found, done = grow(blocks)
    while blocks < most:
        more = min(blocks // 2, most - blocks)
        before, (found, done) = (found.values.size, done), grow(more)
        blocks += more
        if before == (found.values.size, True) and done:
            break
    return found, done


def search(
    linear: Linear, n: int, damping: float
) -> tuple[Found, Found, tuple[float, float], bool]:
    """Find the lowest n modes that oscillate, those that do not, and the band searched [rad/s].

    Last whether all discs were done. Of those that oscillate all are given below the n-th that has
    less than a damping ratio.
    """
    centre = first_rate(linear.params)
    fastest = min(float(linear.params.info["spectral_bound"]), linear.trusted)
    lowest = LOWER * centre * (1.0 - RADIUS)
    found, all_done = disc(linear, 1j * LOWER * centre, RADIUS * LOWER * centre)
    still, _ = disc(linear, complex(-0.5 * centre), DECAYS * 0.5 * centre)
    while True:
        more, done = disc(linear, 1j * centre, RADIUS * centre)
        all_done &= done
        found = _joined(found, more.of(_are_new(more, found.values)))  # those of both count once
        highest = (1.0 + RADIUS) * centre
        swings = -found.values.real < damping * abs(found.values)
        if np.count_nonzero(swings) >= n or centre > fastest:
            break
        centre *= NEXT
    rates = np.sort(abs(found.values[swings]))
    last = rates[min(n, rates.size) - 1] if rates.size else highest
    found = found.of(np.argsort(abs(found.values)))
    still = still.of(abs(still.values.imag) <= SAME * abs(still.values))
    return (
        found.of(abs(found.values) <= last),
        still.of(np.argsort(abs(still.values))),
        (lowest, highest),
        all_done,
    )


def residuals(linear: Linear, found: Found) -> Array:
    """|J x - lambda x| / |lambda x|, unknowns scaled as in vibrations of that frequency."""
    out = np.empty(found.values.size)
    for k, (value, x) in enumerate(zip(found.values, found.vectors.T, strict=True)):
        size = linear.norms(abs(value))
        rest = (linear.matrix @ x - value * x) / size
        out[k] = np.linalg.norm(rest) / (abs(value) * np.linalg.norm(x / size))
    return out


def growing(linear: Linear, band: tuple[float, float], found: Found) -> tuple[Found, bool]:
    """Find what grows, of rates within a band [1/s]; whether all have converged.

    Eigenvalues with a real part > 0 and an imaginary part >= 0 that are not in ``found``, fastest
    first.
    """
    shift, done = max(band[0], 1e-6 * band[1]) / (1.0 - GROWING), True
    grows = found.of([])
    while True:
        more, converged = disc(linear, complex(shift), GROWING * shift)
        done &= converged
        more = more.of(more.values.imag > -SAME * abs(more.values))
        more = more.of(_are_new(more, np.append(grows.values, found.values)))
        real = abs(more.values.imag) < SAME * abs(more.values)
        grows = _joined(grows, Found(np.where(real, more.values.real, more.values), more.vectors))
        if shift * (1.0 + GROWING) > band[1]:
            break
        shift *= NEXT_GROWING
    grows = grows.of(steady_share(linear, grows.vectors) > STEADY)
    return grows.of(np.argsort(-grows.values.real)), done


def _joined(one: Found, other: Found) -> Found:
    return Found(*(np.concatenate(both, axis=-1) for both in zip(one, other, strict=True)))


def _are_new(found: Found, known: Complex) -> NDArray[np.bool_]:
    """Whether each eigenvalue is none of those known."""
    near = SAME * abs(found.values)
    return np.asarray((abs(found.values[:, None] - known) >= near[:, None]).all(axis=1))

"""Results of a run."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base import tables
from ..base.checks import Array, flag, one_of, real_array
from ..base.naming import span_names, with_names
from ..base.rounding import rounded
from ..base.run_warnings import RunWarning
from ..drive.params import Params
from ..drive.sanity import bodies
from ..outputs.arcs import Arcs, arcs_of
from ..outputs.averages import LAST
from ..outputs.histories import GROUPS, grouped, histories
from ..outputs.places import AlongBelt, along, axes_at, momentum_flux
from ..outputs.sampled import Sampled, running
from ..outputs.state import State
from . import exported, labelled, saved

if TYPE_CHECKING:
    from ..report import Report


@attrs.frozen(eq=False, repr=False, kw_only=True)
class Result(Sampled):
    """A run, finished or not.

    Time is the first axis of every array, of n_t samples; n_b links, joints, and n_p pulleys::

        pulleys   theta, omega, torque                             (n_t, n_p)
                  load                                             (n_t, n_p, 2)
        belt      x, y, phi, vx, vy, vphi                          (n_t, n_b)
        joints    deformation, force                               (n_t, n_b)
        contact   pulley, normal, friction, mu, slip, velocity     (n_t, n_b)
        spans     deflection                                       (n_t, n_p, K)
        span_tension, slip                                         (n_t, n_p)
        mounts    travel, travel_speed, ..., belt_force            (n_t, n_m)
        couplings rim_angle, rim_speed, windup, transmitted        (n_t, n_c)
        energy    kinetic, ..., residual, passed                   (n_t,)

    Columns are in the order of ``params.pulleys``, mounts and couplings in that of pulleys that
    have one: ``pulleys.omega[:, params.pulley_index("crank")]``.
    ``span_tension`` is NaN where no link is free in the span or none touches one of its pulleys.
    An ALE belt (``Belt(mesh="ale")``) has cells, which stand still, in place of links and joints,
    in the order of span 0, pulley 1, span 1 and so on to pulley 0; ``spans``, ``belt.flow`` and
    ``belt.passed`` are its own, and it has no ``belt.phi``, ``belt.vphi`` and ``contact.slip``.
    From these: ``hub_load()``, ``along_belt()`` in places fixed in space, ``arcs`` of contact, slip
    and stick.

    Attributes:
        t: Sample times (n_t,) [s]; those reached, if the run did not finish.
        pulleys: Angles, speeds, torques and hub loads of the pulleys.
        belt: Coordinates and velocities of the links.
        joints: Deformation and force of the joints.
        contact: Contact and friction of the links; for a link on two pulleys those of the one with
            the larger normal force.
        spans: Deflection of the spans of an ALE belt.
        mounts: Travels of the mounts from the places of the drive, of arms [rad], of sliders [m],
            and what acts on them (``help(type(result.mounts))``); None in a drive without.
        couplings: Speeds of the rims of pulleys with a coupling, windup and torque between rim and
            shaft (``help(type(result.couplings))``); None in a drive without.
        energy: The energy ledger, None for ``ledger=False``.
        stats: Counters, times and error estimates.
        effects: Names of the effects that were simulated; one that the drive does not have
            (bending, gravity, friction, bearing drag, the ledger) is not computed either.
        success: Whether the run reached its end.
        status: "finished", "failed" or "interrupted".
        message: How the run ended, in words.
        params: The drive.
        prescribed: Names of the pulleys whose motion was given, and is exact.
        final_state: State at the end of the run or, if it did not finish, at the last step; pass
            it as ``initial`` to continue.
        warnings: Everything found that a user may not expect, or that may make the results less
            accurate; each was also issued as a :class:`beltdyn.BeltdynWarning`.
        outputs: The arrays that were asked for, as "joints.force"; None: all that its belt has.
            Reading another is an AttributeError that names it.
        unchecked: Codes of warnings that were not looked for, because the outputs in which they
            show were not asked for.
        accuracy: Its accuracy by quantity, most of it with ``verify=True`` only.
    """

    effects: tuple[str, ...]
    success: bool
    final_state: State
    unchecked: tuple[str, ...] = ()

    @classmethod
    def _from_core(
        cls,
        t: Array,
        arrays: Mapping[str, NDArray[Any]],
        samples: int,
        *,
        params: Params,
        outputs: tuple[str, ...] | None,
        final_state: State,
        **others: Any,
    ) -> Result:
        t = t[:samples]
        done = {name: array[:samples] for name, array in arrays.items()}
        groups = histories(t, done, params, outputs)
        spans = done.get("span_tension")
        with np.errstate(all="ignore"):  # a failed run may end with huge numbers
            seen = running(params, t, done, final_state)
        return cls(
            t=t,
            params=params,
            outputs=outputs,
            final_state=final_state,
            sampled_spans=spans,
            running=seen,
            **groups,
            **others,
        )

    def _keeping(self, outputs: tuple[str, ...] | None) -> Result:
        """Return the same run with some of its arrays alone."""
        if outputs is None:
            return self
        arrays = {
            name: values
            for name, values in self._histories().items()
            if name in outputs or name.partition(".")[0] in outputs
        }
        groups = grouped(arrays, outputs, self.params)
        kept = {name: one for name, one in groups.items() if getattr(self, name) is not None}
        if "span_tension" in outputs:
            kept["sampled_spans"] = self.span_tension
        return attrs.evolve(self, outputs=outputs, **kept)

    def hub_load(self, *, centrifugal: bool = True) -> Array:
        """Return the force of the belt on each pulley in x and y (n_t, n_p, 2) [N].

        On the pulley of a belt that runs at the speed v the spans pull with T_1 and T_2 in their
        directions d_1 and d_2 away from it; but rho v^2 of each serves to turn the belt round, and
        the pulley carries (T_1 - rho v^2) d_1 + (T_2 - rho v^2) d_2, which is ``pulleys.load``.

        Args:
            centrifugal: True: ``pulleys.load``, which the bearings carry. False: the pull of the
                tensions alone, T_1 d_1 + T_2 d_2, as in textbooks for slow belts: the belt's flux
                of momentum is added, from the mean speed of the links along the belt and the
                directions of the belt line (with moving axes where they are at the time).

        Raises:
            TypeError: ``centrifugal`` is not a bool.
            AttributeError: An output that it needs was not asked for; False needs all of ``belt``,
                ``joints.force`` and ``contact.pulley`` as well.
        """
        if flag("centrifugal", centrifugal):
            return self.pulleys.load
        return np.asarray(self.pulleys.load + momentum_flux(self))

    def along_belt(self, name: str = "joints.force", places: ArrayLike | None = None) -> AlongBelt:
        """Return a history of joints or links in places that are fixed in space.

        Joints and links pass; this interpolates linearly, at a fixed place, between the two next to
        it, joints where they are, contact where the mesh has it (at joints, centres of links, or
        masses). Friction and normal forces are those of a link or joint, not per metre. The cells
        of an ALE belt stand in such places themselves, with one tension to a span.

        Places are along the belt line of ``params.route``. Where axes move, a place keeps its share
        of its span or wrap on the line through the axes of the time.

        Args:
            name: An array of ``joints``, ``contact`` or ``belt``: "joints.force", the tension,
                "contact.normal", "belt.vx". Not "contact.pulley", which is no quantity, nor
                "belt.phi", which differs by a turn from the last link to the first.
            places: Where (n_s,) [m], from where the belt leaves pulley 0 on, up to the length of
                the line; None: as many as links, evenly, or the middles of the cells.

        Raises:
            TypeError, ValueError: There is no such array; a place is not on the line.
            AttributeError: It was not asked for, or ``belt`` was not, which this needs.
        """
        known = [
            f"{group}.{one}"
            for group in ("joints", "contact", "belt")
            for one in GROUPS[group].array_names()
            if one not in ("pulley", "phi", "flow", "passed")
            and f"{group}.{one}" not in self._lacking
        ]
        one_of("name", name, known)
        asked = None if places is None else real_array("places", places, ndim=1)
        length = self.params.route.length
        if asked is not None and asked.size and not 0.0 <= asked.min() <= asked.max() <= length:
            raise ValueError(
                f"places must be from 0 to {length:.6g} m, the length of the belt line, got "
                f"{asked.min():.6g} to {asked.max():.6g}"
            )
        return along(self, name, asked)

    @cached_property
    def arcs(self) -> Arcs:
        """Arcs of contact, of slip and of stick on each pulley over time (:class:`Arcs`).

        Needs ``belt.x``, ``.y``, ``.phi`` and ``contact.pulley``, ``.normal``, ``.mu`` and
        ``.velocity``; an AttributeError names what was not asked for.
        """
        return arcs_of(self, axes_at(self.params, self._travel))

    @cached_property
    def slip(self) -> Array:
        """Speed lost against pulley 0, 1 - omega_k r_k / (omega_0 r_0) (n_t, n_p) [1].

        Not all of it is creep: where the belt sinks into its pulleys it runs on smaller radii.
        :meth:`report` splits it into stretch, friction and radius.

        For a pulley on the outside, which turns the other way round, with -omega_k.

        NaN while pulley 0 almost stands still, below a thousandth of its highest speed.
        """
        rims = self._rims()
        if rims is None:  # says which of them was not asked for
            _ = self.pulleys.omega, self.couplings and self.couplings.rim_speed
        return self._slip(np.asarray(rims))

    def _slip(self, omega: Array) -> Array:
        speed = omega * self.params._rolling
        first = np.abs(speed[:, :1])
        stands = first <= 1e-3 * np.max(first, initial=0.0)
        return np.where(stands, np.nan, 1.0 - speed / np.where(stands, 1.0, speed[:, :1]))

    def report(self, last: float = 0.2, *, joint: int = 0) -> Report:
        """Return what an engineer reads off the last part of the run; print it.

        Pulleys: speeds, torques, powers, hub loads, arcs of contact and slip, tension ratios, the
        margin of torque to full slip. Spans: tensions, the strongest line in them, the frequency as
        a moving string. Mounts: travel, distance to a stop, forces. Creep split into its causes,
        where every watt goes, load cycles of a link.

        Args:
            last: The part of the run, counted from its end, as a share of it, not in seconds: 0.2
                is its last fifth; 0 < last <= 1.
            joint: The joint whose load cycles are counted, between links joint - 1 and joint.

        Returns:
            The report, as far as the outputs allow; it says what is missing, and why.

        Raises:
            TypeError, ValueError: ``last`` or ``joint`` breaks its rule; the run has less than two
                samples.
        """
        from ..report import make_report  # which no run needs

        return make_report(self, last, joint)

    def __repr__(self) -> str:
        span = f"t = {self.t[0]:g} to {self.t[-1]:g} s" if self.t.size else "no samples"
        return (
            f"Result({self.status}: {self.t.size} samples, {span}, "
            f"{bodies(self.params)}, {len(self.params.pulleys)} pulley(s); "
            f"{self.stats.method}, {self.stats.steps} steps, {self.stats.cpu_time:.3g} s CPU)"
        )

    def __str__(self) -> str:
        return "\n".join([repr(self), *tables.columns(self.summary(), "<")])

    def _repr_html_(self) -> str:
        rows = [(label.replace("  ", "\u2003"), value) for label, value in self.summary()]
        return tables.html([repr(self), tables.Table("", (), rows, [*map(str, self.warnings)])])

    def summary(self, verbose: bool = False) -> list[tuple[str, str]]:
        """List the most important results, and how accurate they are, as pairs of label and value.

        Speeds, tensions and creep are means over the last fifth of the run, because links that
        arrive at a pulley or leave it make them fluctuate from sample to sample. They have as many
        digits as their error allows, two where it is not known.

        Args:
            verbose: Whether to add what the integrator did.
        """
        names = self.params.pulley_names
        spans, named = span_names(names), any(one.name for one in self.params.pulleys)

        from ..report import Window, creep_rows, speed_errors  # which no run needs

        def listed(values: Array, error: ArrayLike | None, of: Sequence[str], unit: str) -> str:
            off = np.broadcast_to(np.nan if error is None else error, values.shape)
            texts = [
                "-" if v != v else f"{rounded(v, e)[0]:.5g}"
                for v, e in zip(values, off, strict=True)
            ]
            return (with_names(texts, of) if named else ", ".join(texts)) + unit

        stats = self.stats
        ended = self.status if self.success else f"{self.status}: {self.message}"
        rows = [("status", ended), ("time", f"{self.final_state.t:.6g} s")]
        if self.warnings:
            rows.append(("warnings", f"{len(self.warnings)}: {', '.join(_named(self.warnings))}"))
        if self.unchecked:
            rows.append(("  not looked for", f"{', '.join(self.unchecked)}, for want of outputs"))
        of_tension, of_creep = (self.accuracy[one].known for one in ("span_mean", "creep"))
        if self.t.size:
            window = Window.last(self, LAST)
            rows.append(("mean over", f"the last {window.lasts:.3g} s"))
            if self._has("pulleys.omega"):
                speeds = window.mean(window.of(self.pulleys.omega))
                errors = speed_errors(self.accuracy, speeds, np.isin(names, self.prescribed))
                rows.append(("  pulley speeds", listed(speeds, errors, names, " rad/s")))
            if self._has("span_tension"):
                means = window.mean(window.of(self.span_tension))
                error = of_tension and of_tension * abs(float(np.nanmean(means)))
                tensions = listed(means, error, spans, " N")
                rows.append(("  span tensions", tensions))
            moving = self.params._moving
            if self.mounts is not None and moving and self._has("mounts.travel"):
                travel = window.mean(window.of(self.mounts.travel))
                for m, *_ in moving:  # two spans of the belt move it
                    if of_tension:
                        travel[m] = rounded(travel[m], 2.0 * of_tension * abs(travel[m]))[0]
                texts = [f"{names[k]}: {on._row.travel_text(travel[m])}" for m, k, on in moving]
                rows.append(("  mounts, from their places", ", ".join(texts)))
            if lost := creep_rows(window):
                driver = names[window.driver or 0]
                of = [one.name for one in lost]
                parts = np.array([(one.slower, one.as_share * one.creep) for one in lost])
                percent = 100.0 * parts.T
                error = of_creep and of_creep * float(np.max(np.abs(percent)))
                rows.append((f"  speed lost against {driver}", listed(percent[0], error, of, " %")))
                # The rest is running radii: report() has all parts.
                rows.append(("    by creep alone", listed(percent[1], error, of, " %")))
            elif (rims := self._rims()) is not None:  # its split is not known
                slip = self._slip(window.mean(window.of(rims))[None])[0, 1:]
                # Beyond 100 % the pulleys turn in opposite directions and slip has no meaning.
                if slip.size and (np.abs(slip) <= 1.0).all():
                    against = f"  speed lost against {names[0]}"
                    rows.append((against, listed(100 * slip, None, names[1:], " %")))
        rows += self.accuracy.summary()
        if note := self.params._belt_facts["note"]:
            rows.append(("  mesh", note))
        if self.t.size and self.energy is not None and self._has("energy"):
            residual, passed = self.energy.residual[-1], self.energy.passed[-1]
            share = f"{abs(residual) / passed:.2g} of {passed:.3g} J" if passed > 0 else "nothing"
            rows.append(("  energy unaccounted for", f"{residual:.2g} J, {share} transmitted"))
        rows.append(("CPU time", f"{stats.cpu_time:.3g} s"))
        return rows + (self._of_integrator() if verbose else [])

    def _of_integrator(self) -> list[tuple[str, str]]:
        stats = self.stats
        return [
            ("method", stats.choice or stats.method),
            ("steps", f"{stats.steps} accepted, {stats.rejected} rejected"),
            ("  shortest, longest", f"{stats.smallest_step:.3g} s, {stats.largest_step:.3g} s"),
            ("local error", "-" if stats.local_error is None else f"{stats.local_error:.2g}"),
            ("rates evaluated", f"{stats.nfev}"),
            ("Jacobians, factorisations", f"{stats.njev}, {stats.nlu}"),
            ("settling", f"{stats.settle_time:.3g} s"),
            ("instruction level", stats.kernels),
        ]

    def to_xarray(self) -> Any:
        """Return an ``xarray.Dataset`` with every array that there is, its unit and its text.

        Variables have the names of outputs, "joints.force", "energy.kinetic", "span_tension", over
        "time" and "pulley", "span", "link", "joint", "mount" or "xy", whose coordinates are names
        and numbers: ``data["pulleys.omega"].sel(pulley="crank")``. ``data.attrs`` has the drive as
        TOML ("scene"), "beltdyn_version", "kernels", "method", "status", "message" and "warnings",
        one a line. ``data.to_netcdf(path)`` writes it, and all comes back equal.

        Returns:
            A dataset that shares its arrays with the result.

        Raises:
            ImportError: xarray is not installed.
        """
        attributes = {
            "title": f"Run of {bodies(self.params)} on {len(self.params.pulleys)} pulley(s)",
            "scene": self.params.to_toml(),
            "beltdyn_version": _core.__version__,
            "kernels": self.stats.kernels,
            "method": self.stats.method,
            "status": self.status,
            "message": self.message,
            "warnings": "\n".join(map(str, self.warnings)),
        }
        return labelled.dataset(self, attributes)

    def _history(self, name: str) -> Any:
        """Return an output over time by its dotted name; ValueError where there is none."""
        group, _, field = name.rpartition(".")
        held = getattr(self, group) if group else self
        if held is None and group == "energy":
            raise ValueError(f"{name}: the run carries no energy ledger (options ledger=False)")
        if held is None:
            raise ValueError(f"{name}: this drive has no {group}")
        return getattr(held, field)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file of the kind that the ending of ``path`` names.

        - ``.npz``, and a name without an ending: all of the result; what :meth:`load` reads. Arrays
          have dotted names, such as "belt.x".
        - ``.nc``: netCDF, the dataset of :meth:`to_xarray` (needs the extra ``sweep``).
        - ``.csv``: a row for each sample, a column for each number, with a head such as
          "pulleys.omega[1] (rad/s)"; each reads as the same number again. Of all links it is wide:
          ``outputs=`` of :func:`beltdyn.simulate` leaves out what is not wanted.
        - ``.mat``: for MATLAB: ``t``, a struct for each group (``pulleys.omega``), ``span_tension``
          and ``scene``, the drive as TOML (needs SciPy).

        Raises:
            ImportError: A package that this kind needs is not installed.
            OSError: It cannot be written; a file that was there before is unchanged.
            ValueError: It has another ending.
        """
        ending = exported.check_ending(path)
        if ending == ".npz":
            saved.write(self, path)
        elif ending == ".nc":
            exported.write_netcdf(self.to_xarray(), path)
        else:
            exported.write(self, path, ending)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Result:
        """Read an ``.npz`` file of :meth:`save`; nothing in it is executed, all of it is checked.

        Raises:
            OSError: The file cannot be read.
            MemoryError: It is larger than the memory.
            ValueError: It is not a saved result, or one of another format; the message says what is
                wrong.
        """
        return saved.read(path, lambda fields: cls(**fields))


def _named(warnings: tuple[RunWarning, ...]) -> list[str]:
    """Name each warning, with the pulley or span if several have the same code."""
    codes = [one.code for one in warnings]
    return [
        f"{one.code} ({one.where})" if codes.count(one.code) > 1 and one.where else one.code
        for one in warnings
    ]

"""The paper's figures from our runs, with the numbers that the paper states marked in them.

:data:`FIGURES` holds one function per figure, 5 to 19. Axes and units are the paper's. Signs are
those of the package: counter-clockwise is positive, so the speeds of case 1 are negative, and a
driving torque of -100 N m stands where the paper's text has -50. Elements are numbered from 1, as
in the paper. A mark is as wide as the scale of its quantity in :data:`beltdyn_kubas.QUANTITIES`,
the deviation accepted or the precision to which the text can be read.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import attrs
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import beltdyn as bd

from .cases import LINKS, RAMP_END, REVERSALS, Runs
from .marks import BAND, INK, LINE, Marks, legend_entry, number
from .paper_numbers import QUANTITIES, Links, dahl

__all__ = ["FIGURES", "SIZES", "PaperFigure", "Size", "figure"]

_Q = {quantity.name: quantity for quantity in QUANTITIES}
#: The driving torque that the paper's text prints, of both cases [N m]; its forces need twice it.
_TEXT_TORQUE = 50.0
_HEADING_TORQUE = -100.0
#: The time at which the paper shows the forces along the belt [s].
_SNAPSHOT = 0.4
_GREY = "0.45"
#: For lines that oscillate too fast for dashes: a dark and a light colour, distinct in grey too.
_DENSE = {"linestyle": "-", "linewidth": 0.7}
_BLUE, _RED, _ORANGE = "#0072B2", "#D55E00", "#E69F00"
_DARK_AND_LIGHT = (_BLUE, _ORANGE)
_ELEMENT, _JOINT = "element {}", "joint left of element {}"


class Size(NamedTuple):
    """Size of a figure.

    Attributes:
        panel: Width and height of a panel [inch].
        font: Size of its text [pt].
        line: Width of its lines [pt].
        dpi: Resolution as a picture.
    """

    panel: tuple[float, float]
    font: float
    line: float
    dpi: float


#: "print": a panel as wide as the column of a two-column journal.
SIZES = {
    "notebook": Size((5.6, 3.9), 10.0, 1.2, 90.0),
    "print": Size((3.4, 2.7), 7.5, 0.8, 300.0),
}


class _Figure(Figure):
    """A figure that a notebook shows without pyplot."""

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


class _Panel(NamedTuple):
    """Axes, runs, links, marks and line style of a panel."""

    ax: Axes
    runs: Runs
    links: Links
    marks: Marks
    line: dict[str, Any]


@attrs.frozen
class PaperFigure:
    """A figure of the paper; called, it draws itself.

    Attributes:
        number: Its number in the paper.
        caption: Its caption.
        panels: Functions that draw its panels, lettered (a), (b) if there are several.
        taller: Height of its panels over that of the size.
    """

    number: int
    caption: str
    panels: tuple[Callable[[_Panel], None], ...]
    taller: float = 1.0

    def __call__(self, runs: Runs, *, links: Links = LINKS, size: str = "notebook") -> Figure:
        """Draw it.

        Args:
            runs: The three runs, of :func:`beltdyn_kubas.runs`.
            links: The chosen elements.
            size: "notebook" or "print".

        Raises:
            ValueError: ``size`` is none of these.
        """
        if size not in SIZES:
            raise ValueError(f"size must be one of {', '.join(SIZES)}, got {size!r}")
        (width, height), font, line, dpi = SIZES[size]
        count = len(self.panels)
        # For the time of the drawing: sizes of text are fixed when it is made.
        with matplotlib.rc_context({"font.size": font, "axes.linewidth": 0.6}):
            figsize = (count * width, self.taller * height)
            drawn = _Figure(figsize=figsize, dpi=dpi, layout="constrained")
            axes = drawn.subplots(1, count, squeeze=False)[0]
            for k, (ax, draw) in enumerate(zip(axes, self.panels, strict=True)):
                panel = _Panel(ax, runs, links, Marks(ax), {"linewidth": line})
                draw(panel)
                panel.marks.finish()
                ax.tick_params(labelsize="small")
                if count > 1:
                    ax.set_xlabel(f"{ax.get_xlabel()}\n({'ab'[k]})")
            drawn.suptitle(f"Fig. {self.number}. {self.caption}", fontsize="medium")
            _add_legend(drawn)
            drawn.draw_without_rendering()
        return drawn


def figure(number: int, runs: Runs, *, links: Links = LINKS, size: str = "notebook") -> Figure:
    """Draw a figure of the paper by its number.

    Args:
        number: 5 to 19.
        runs: The three runs, of :func:`beltdyn_kubas.runs`.
        links: The chosen elements.
        size: "notebook", or "print": panels as wide as the column of a two-column journal.

    Raises:
        ValueError: There is no such figure or size.
    """
    if number not in FIGURES:
        raise ValueError(f"number must be from {min(FIGURES)} to {max(FIGURES)}, got {number!r}")
    return FIGURES[number](runs, links=links, size=size)


def _add_legend(drawn: Figure) -> None:
    """Add one legend for all panels, below them."""
    handles: dict[str, Any] = {}
    marked = False
    for ax in drawn.axes:
        _remove_legend(ax)
        marked |= any(line.get_color() == INK for line in ax.lines)
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if marked:
        handles["paper"] = legend_entry()
    if not handles:
        return
    room = drawn.bbox.width
    for columns in range(len(handles), 0, -1):
        legend = drawn.legend(
            handles.values(), handles.keys(), loc="outside lower center", ncols=columns,
            frameon=False, fontsize="small", handlelength=2.2, columnspacing=1.2,
        )  # fmt: skip
        if columns == 1 or legend.get_window_extent().width < room:
            return
        legend.remove()


def _remove_legend(ax: Axes) -> None:
    legend = ax.get_legend()
    if legend is not None:
        legend.remove()


# --- what the panels share -----------------------------------------------------------------------


def _pulley_lines(draw: Callable[..., Axes], panel: _Panel, result: bd.Result, **line: Any) -> None:
    for k, name in enumerate(("driving pulley", "driven pulley")):
        colour = {"color": _DARK_AND_LIGHT[k]} if line else {}
        draw(result, pulleys=k, ax=panel.ax, label=name, **(panel.line | line | colour))
    panel.ax.set_xlim(0.0, 1.0)


def _over_time(
    draw: Callable[..., Axes], panel: _Panel, case: int, label: str, *times: str, **how: Any
) -> None:
    """Draw a curve of the chosen element, which the label counts, and mark times of the paper."""
    link = panel.links[case - 1]
    label = label.format(link + 1)
    draw(panel.runs[case - 1], link, ax=panel.ax, label=label, **panel.line, **how)
    panel.ax.set_xlim(0.0, 1.0)
    for name in times:
        panel.marks.time(_Q[name])


def _over_slip(panel: _Panel, case: int) -> None:
    link = panel.links[case - 1]
    look = panel.line | {"label": _ELEMENT.format(link + 1)}
    bd.plot.friction_coefficient(panel.runs[case - 1], link, against="slip", ax=panel.ax, **look)


def _mark_mu_k(panel: _Panel, result: bd.Result, *signs: int) -> None:
    for sign in signs:
        label = "$\\mu_k$" if sign > 0 else "$-\\mu_k$"
        panel.marks.level(sign * dahl(result).mu_k, label=label)


def _sign_1(panel: _Panel) -> float:
    """Sign of friction in case 1: the paper prints absolute values and says they are negative."""
    return float(np.sign(panel.runs.case_1.contact.mu[:, panel.links.case_1].sum()))


def _mark_text_torque(panel: _Panel, times: tuple[float, ...], signs: tuple[int, ...]) -> None:
    for time in times:
        panel.marks.at(time)
    for sign in signs:
        panel.marks.level(sign * _TEXT_TORQUE, label=f"{number(sign * _TEXT_TORQUE)} in\nthe text")


# --- case 1 --------------------------------------------------------------------------------------


def _drive(panel: _Panel) -> None:
    """Fig. 5."""
    ax, result, links = panel.ax, panel.runs.case_1, panel.links
    names = {f"case {case}: element {link + 1}": link for case, link in enumerate(links, start=1)}
    bd.plot.drive(result, float(result.t[0]), colour=None, arcs=False, links=names, ax=ax)
    ax.set_title("")
    first, second = result.params.pulleys
    ends = {"arrowstyle": "<->", "color": INK, "lw": 0.9, "shrinkA": 0, "shrinkB": 0}
    y = first.center[1] - 0.55 * first.radius
    ax.annotate("", (first.center[0], y), (second.center[0], y), arrowprops=ends)
    middle = (first.center[0] + second.center[0]) / 2.0
    apart = second.center[0] - first.center[0]
    text: dict[str, Any] = {"color": INK, "fontsize": "small"}
    text["bbox"] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}
    ax.text(middle, y, f"$l_p$ = {apart:.3f} m", ha="center", va="center", **text)
    top = (second.center[0], second.center[1] + second.radius)
    ax.annotate("", top, second.center, arrowprops={**ends, "arrowstyle": "->"})
    side, level = second.center[0] - 0.06 * second.radius, second.center[1] + 0.5 * second.radius
    ax.text(side, level, f"$r_p$ = {second.radius:g} m", ha="right", va="center", **text)


def _torques_1(panel: _Panel) -> None:
    """Fig. 6."""
    _pulley_lines(bd.plot.torques, panel, panel.runs.case_1)
    _mark_text_torque(panel, (RAMP_END,), (-1,))
    panel.marks.level(_HEADING_TORQUE, label=f"{number(_HEADING_TORQUE)} in\nthe heading")


def _speeds_1(panel: _Panel) -> None:
    """Fig. 7."""
    _pulley_lines(bd.plot.speeds, panel, panel.runs.case_1)
    panel.marks.at(RAMP_END)
    omega = _Q["omega_1"]
    panel.marks.level(omega.paper, omega.scale, "$-2\\pi$", span=(RAMP_END, 1.0))
    close = panel.ax.inset_axes((0.42, 0.36, 0.56, 0.46))
    _pulley_lines(bd.plot.speeds, panel._replace(ax=close), panel.runs.case_1)
    Marks(close).level(omega.paper, omega.scale)
    close.set(
        xlim=(RAMP_END, 1.0), ylim=(1.07 * omega.paper, 0.95 * omega.paper), xlabel="", ylabel=""
    )
    close.tick_params(labelsize="x-small")
    _remove_legend(close)


def _deformation(panel: _Panel) -> None:
    """Fig. 8a."""
    _over_time(bd.plot.joint_deformation, panel, 1, _JOINT, "arrival", "departure")


def _force_1(panel: _Panel) -> None:
    """Fig. 8b."""
    _over_time(bd.plot.joint_force, panel, 1, _JOINT, "arrival", "departure")


def _along(panel: _Panel) -> None:
    """Fig. 9; joints and marks are half a number to the left of their elements."""
    result, marks = panel.runs.case_1, panel.marks
    bd.plot.force_along_belt(
        result, _SNAPSHOT, first=1, wraps=False, ax=panel.ax, label="joint force", **panel.line
    )
    count = result.params.n_bodies
    firsts = [_Q[name] for name in ("growing", "grown", "falling", "fallen")]
    for quantity in firsts:
        panel.ax.axvspan(
            quantity.paper - 1.0 - quantity.scale,
            quantity.paper - 1.0 + quantity.scale,
            **BAND,
        )
        panel.ax.axvline(quantity.paper - 1.0, **LINE)
    numbers = [1, *(round(quantity.paper) for quantity in firsts), count + 1]
    for first, after in pairwise(numbers):
        marks.name((first + after) / 2.0 - 1.0, f"{first}\N{EN DASH}{after - 1}")
    marks.value(_Q["passive"])
    marks.value(_Q["active"])


def _normal_1(panel: _Panel) -> None:
    """Fig. 10a."""
    times = ("lost", "regained", "equal")
    _over_time(bd.plot.contact_forces, panel, 1, "normal force N", *times, which="normal")
    panel.ax.set_ylabel("normal force [N]")


def _friction_1(panel: _Panel) -> None:
    """Fig. 10b, with the normal force for comparison."""
    ax, result, link = panel.ax, panel.runs.case_1, panel.links.case_1
    sign = _sign_1(panel)
    normal = sign * result.contact.normal[:, link]
    ax.plot(
        result.t,
        normal,
        color=_GREY,
        lw=panel.line["linewidth"],
        label="\N{MINUS SIGN}N" if sign < 0 else "N",
    )
    look = panel.line | {"color": _RED, "linestyle": "-"}
    bd.plot.contact_forces(result, link, which="friction", ax=ax, label="friction force", **look)
    ax.set_ylabel("friction force [N]")
    ax.set_xlim(0.0, 1.0)
    panel.marks.time(_Q["equal"])


def _mu_time_1(panel: _Panel) -> None:
    """Fig. 11a."""
    times, sign = ("arrival", "lost", "regained", "full", "departure"), _sign_1(panel)
    _over_time(bd.plot.friction_coefficient, panel, 1, _ELEMENT, *times)
    panel.marks.value(_Q["peak"], sign=sign, span=(_Q["arrival"].paper, _Q["lost"].paper))
    _mark_mu_k(panel, panel.runs.case_1, int(sign))


def _mu_slip_1(panel: _Panel) -> None:
    """Fig. 11b."""
    sign = _sign_1(panel)
    _over_slip(panel, 1)
    panel.marks.value(_Q["peak"], sign=sign)
    _mark_mu_k(panel, panel.runs.case_1, int(sign))


def _velocity(panel: _Panel) -> None:
    """Fig. 12: the paper states no number, only that the direction changes."""
    _over_time(bd.plot.relative_velocity, panel, 1, _ELEMENT)
    panel.ax.axhline(0.0, color=_GREY, lw=0.8, zorder=1.0)


# --- case 2 --------------------------------------------------------------------------------------


def _torques_2(panel: _Panel) -> None:
    """Fig. 13."""
    _pulley_lines(bd.plot.torques, panel, panel.runs.case_2)
    _mark_text_torque(panel, REVERSALS, (-1, 1))


def _speeds_2(panel: _Panel) -> None:
    """Fig. 14."""
    _pulley_lines(bd.plot.speeds, panel, panel.runs.case_2, **_DENSE)
    _mark_differences(panel, panel.runs.case_2)


def _mark_differences(panel: _Panel, result: bd.Result) -> None:
    """Draw two bars at the distance of the paper's speeds, centred on ours."""
    for k, time in enumerate(REVERSALS, start=1):
        quantity = _Q[f"difference_{k}"]
        before = (result.t >= time - 0.02) & (result.t <= time)
        middle = float(result.pulleys.omega[before].mean())
        for side in (-0.5, 0.5):
            y = middle + side * quantity.paper
            span = (time - 0.06, time)
            half = quantity.scale / 2.0
            panel.ax.fill_between(span, y - half, y + half, **(BAND | {"zorder": 3, "alpha": 0.8}))
            panel.ax.plot(span, [y, y], label="_paper", **(LINE | {"zorder": 3.1}))
        panel.marks.at(time, label=f"{time:g} s: {quantity.paper:g} rad/s apart")


def _force_2(panel: _Panel) -> None:
    """Fig. 15."""
    result, link = panel.runs.case_2, panel.links.case_2
    _over_time(bd.plot.joint_force, panel, 2, _JOINT)
    force = result.joints.force[:, link]
    places = {
        "start": 0.0, "minimum": result.t[force.argmin()],
        "maximum": result.t[force.argmax()], "end": 1.0,
    }  # fmt: skip
    for name, place in places.items():
        panel.marks.value(_Q[name], span=(max(place - 0.08, 0.0), min(place + 0.08, 1.0)))


def _forces_2(panel: _Panel) -> None:
    """Fig. 16."""
    result, link = panel.runs.case_2, panel.links.case_2
    for force in ("normal", "friction"):
        _over_time(bd.plot.contact_forces, panel, 2, f"{force} force", which=force)
    friction = result.contact.friction[:, link]
    top = int(np.abs(friction).argmax())
    place = float(result.t[top])
    panel.marks.value(
        _Q["friction"],
        sign=float(np.sign(friction[top])),
        span=(place - 0.15, min(place + 0.15, 1)),
    )


def _mu_time_2(panel: _Panel) -> None:
    """Fig. 17a."""
    times = ("negative_from", "negative_to", "positive_from", "positive_to")
    _over_time(bd.plot.friction_coefficient, panel, 2, _ELEMENT, *times)
    _mark_mu_k(panel, panel.runs.case_2, -1, 1)


def _mu_slip_2(panel: _Panel) -> None:
    """Fig. 17b."""
    _over_slip(panel, 2)
    extreme, back = _Q["extreme"], _Q["return"]
    panel.marks.at(extreme.paper, extreme.scale)
    panel.marks.at(extreme.paper + back.paper, back.scale)
    _mark_mu_k(panel, panel.runs.case_2, -1, 1)


def _two_sigmas(panel: _Panel) -> None:
    """Fig. 18; (2.9) leaves -mu_k with the slope 2 sigma, drawn to the next half of mu_k."""
    link, mm = panel.links.case_2, 1e-3
    for result in (panel.runs.case_2, panel.runs.case_2_soft):
        sigma, mu_k = dahl(result).sigma, dahl(result).mu_k
        label = f"$\\sigma$ = {sigma:g} 1/m"
        bd.plot.friction_coefficient(
            result, link, against="slip", ax=panel.ax, label=label, **panel.line
        )
        first = result.t <= sum(REVERSALS) / 2.0
        turn = float(result.contact.slip[first, link].min()) / mm
        rise = np.array([-1.0, 0.0]) * mu_k
        run = turn + (rise + mu_k) / (2.0 * sigma * mm)
        panel.ax.plot(run, rise, label="_paper", **LINE)
        # Beside the end of its tangent, outside the loop or within it.
        outside = result is panel.runs.case_2_soft
        panel.ax.annotate(
            f"{2.0 * sigma * mm:g} per mm", (run[-1], rise[-1]), (-5 if outside else 3, 0),
            textcoords="offset points", color=INK, fontsize="small",
            ha="right" if outside else "left", va="bottom" if outside else "top",
        )  # fmt: skip
    panel.ax.margins(x=0.18)


def _speeds_soft(panel: _Panel) -> None:
    """Fig. 19, over Fig. 14 in grey."""
    _pulley_lines(bd.plot.speeds, panel, panel.runs.case_2_soft, **_DENSE)
    stiff = panel.runs.case_2
    for k in range(2):
        panel.ax.plot(
            stiff.t, stiff.pulleys.omega[:, k], color="0.75", lw=0.6, zorder=1.2,
            label="Fig. 14" if k == 0 else None,
        )  # fmt: skip


#: The paper's figures by number, each a function ``(runs, *, links, size) -> Figure``.
FIGURES: dict[int, PaperFigure] = {
    one.number: one
    for one in (
        PaperFigure(5, "The drive and the chosen elements", (_drive,), taller=0.85),
        PaperFigure(6, "Torques set on the pulleys, case 1", (_torques_1,)),
        PaperFigure(7, "Speeds of the pulleys, case 1", (_speeds_1,)),
        PaperFigure(
            8, "Deformation and force of the chosen joint, case 1", (_deformation, _force_1)
        ),
        PaperFigure(9, "Joint force along the belt at 0.4 s", (_along,)),
        PaperFigure(10, "Contact forces of the chosen element, case 1", (_normal_1, _friction_1)),
        PaperFigure(
            11, "Friction coefficient of the chosen element, case 1", (_mu_time_1, _mu_slip_1)
        ),
        PaperFigure(12, "Relative velocity of the chosen element, case 1", (_velocity,)),
        PaperFigure(13, "Torques set on the pulleys, case 2", (_torques_2,)),
        PaperFigure(14, "Speeds of the pulleys, case 2", (_speeds_2,)),
        PaperFigure(15, "Force of the chosen joint, case 2", (_force_2,)),
        PaperFigure(16, "Contact forces of the chosen element, case 2", (_forces_2,)),
        PaperFigure(
            17, "Friction coefficient of the chosen element, case 2", (_mu_time_2, _mu_slip_2)
        ),
        PaperFigure(18, "Friction over slip for two values of $\\sigma$, case 2", (_two_sigmas,)),
        PaperFigure(19, "Speeds of the pulleys, case 2, $\\sigma$ = 5000 1/m", (_speeds_soft,)),
    )
}

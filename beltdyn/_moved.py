"""Modules by the names that they had before they moved into rooms.

Importing one by such a name is an error that says where it is now. Public names never moved:
they are those of :mod:`beltdyn` itself.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from types import ModuleType

_KEPT_NAMES = {
    "outputs": "accuracy_report arcs averages histories places spans state",
    "drive": (
        "balance cells compliance couplings mounts parameters params parts preload route "
        "rules sanity scene tensioning toml"
    ),
    "base": "checks described files naming npz optional progress rounding run_warnings stopping",
    "run": "checkpoints memory observed resuming settling simulation start_of_run",
    "result": "errors exported labelled saved",
    "loads": "motions torques",
    "scenes": "machines",
    "many": "pools",
}
#: Modules by their old names; ``outputs``, ``result``, ``loads`` and ``scenes`` are rooms now.
MOVED = {
    **{old: f"{room}.{old}" for room, names in _KEPT_NAMES.items() for old in names.split()},
    "accuracy.budget": "verification.budget",
    "accuracy.pilot": "verification.forecast",
    "accuracy.quantities": "verification.quantities",
    "accuracy.rows": "accuracy.study_table",
    "accuracy.runs": "verification.runs",
    "accuracy.settings": "verification.runs",
    "accuracy.space": "verification.space",
    "accuracy.table": "accuracy.study_table",
    "accuracy.verification": "verification.verification",
    "columns": "base.tables",
    "cli.figures": "cli.figures_command",
    "cli.resuming": "cli.commands",
    "cli.sweeping": "cli.sweep_command",
    "escaped": "loads.callback_errors",
    "explaining.text": "explaining.explanation",
    "explaining.window": "explaining.run_length",
    "gross_slip": "outputs.arcs",
    "hard": "scenes.hard_scenes",
    "html": "base.tables",
    "identification.report": "identification.findings",
    "plot.accuracy": "accuracy.study_figures",
    "plot.figures": "plot.picture",
    "plot.friction": "plot.history",
    "plot.modes": "plot.mode_shapes",
    "plot.places": "plot.history",
    "plot.spectrum": "plot.spectrum_lines",
    "published": "scenes.machines",
    "report.spans": "report.span_rows",
    "spectra.sources": "outputs.orders",
    "sweeping.content": "many.content",
    "sweeping.identity": "many.identity",
    "sweeping.rows": "sweeping.outcomes",
    "sweeping.table": "sweeping.dataset",
    "vibration.linear": "vibration.linearised",
    "vibration.mesh_phases": "vibration.equilibrium",
    "vibration.search": "vibration.eigenvalues",
}


class _Moved(MetaPathFinder):
    """Asked last, for what no other finder knows."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> None:
        package, _, name = fullname.partition(".")
        if package == __package__ and name.partition(".")[0] == "kubas":
            raise ImportError(f"{fullname} has moved to beltdyn_kubas", name=fullname)
        if package == __package__ and name in MOVED:
            raise ImportError(
                f"{fullname} has moved to {package}.{MOVED[name]}; what is public is imported "
                f"from {package} itself",
                name=fullname,
            )


sys.meta_path.append(_Moved())

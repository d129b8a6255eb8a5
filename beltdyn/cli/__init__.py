"""The command line: ``beltdyn show SCENE``, ``beltdyn run SCENE``, ``beltdyn figures`` and more.

Exit codes: 0 fine, 1 the run failed or a file could not be written, 2 bad input, 130 interrupted. A
run that fails or is interrupted still writes what it computed. Results go to stdout; errors and
warnings, one line each after the results, to stderr. Warnings do not change the exit code.
"""

from __future__ import annotations

from .commands import main
from .figures_command import draw_figures
from .sweep_command import sweep_scene

__all__ = ["main"]

main.add_command(draw_figures)
main.add_command(sweep_scene)

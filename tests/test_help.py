"""What help, dir and tab completion show of the package."""

from __future__ import annotations

import inspect
import pickle
import pydoc
from html import escape

import attrs
import pytest

import beltdyn as bd

CLASSES = [
    one
    for module in (bd, bd.accuracy, bd.spectra)
    for one in (getattr(module, name) for name in module.__all__)
    if inspect.isclass(one) and not issubclass(one, BaseException)
]


def test_dir_lists_what_one_writes() -> None:
    """No modules of the inside, no names of other packages; the others are there all the same."""
    shown = dir(bd)
    assert len(shown) < 65 and len(set(shown)) == len(shown)
    assert all(hasattr(bd, name) for name in shown if name != "plot")
    assert {"Belt", "Params", "simulate", "Motor", "scenes", "plot"} <= set(shown)
    assert not {"Any", "import_module", "checks", "npz", "Stats", "annotations"} & set(shown)
    hidden = {"Stats", "Report", "Modes", "Accuracy"}
    assert all(hasattr(bd, name) for name in hidden) and hidden <= set(bd.__all__)
    assert set(bd.__all__) - set(shown) <= {one for one in bd.__all__ if one[0].isupper()}


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_signatures_have_the_types_of_the_fields(cls: type) -> None:
    text = str(inspect.signature(cls))
    assert "ForwardRef" not in text and "'object" not in text
    assert "ForwardRef" not in pydoc.plain(pydoc.render_doc(cls)).split("__annotations__")[0]


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_help_shows_no_notes_of_attrs(cls: type) -> None:
    """But its fields, which attrs reads there, their types, resolved once a drive was read from a
    file, and what a class does after its arguments.
    """
    noted = {name for name in dir(cls) if name.startswith("__attrs_")}
    assert noted <= {"__attrs_attrs__", "__attrs_types_resolved__", "__attrs_post_init__"}


@pytest.mark.parametrize("cls", list(filter(attrs.has, CLASSES)), ids=lambda cls: cls.__name__)
def test_fields_have_the_texts_of_the_docstring(cls: type) -> None:
    text = inspect.getdoc(cls)
    section = text.partition("Attributes:")[2] or text.partition("Args:")[2]
    for field in attrs.fields(cls):
        if f"{field.name}: " in section and hasattr(cls, field.name):
            assert inspect.getdoc(getattr(cls, field.name)), field.name


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_misspelt_fields_are_answered_with_those_that_there_are(cls: type) -> None:
    fields = [name for name in inspect.signature(cls).parameters if name != "_cls"]
    if not fields or not (attrs.has(cls) or hasattr(cls, "_fields")):
        return
    first = max(fields, key=len)
    meant = rf"unknown field \(did you mean '{first}'\?\); the fields are {', '.join(fields)}$"
    with pytest.raises(TypeError, match=rf"^{cls.__name__}\.{first}x: {meant}"):
        cls(**{f"{first}x": None})
    with pytest.raises(TypeError, match=r"positional|required"):
        cls(*range(99))


def test_misspelt_arguments_are_answered_with_one_that_there_is() -> None:
    """Of functions and methods; signatures and pickles are those of the function itself."""
    result = bd.simulate(*bd.scenes.kubas_case_1()[:2], 1e-4)
    for call, message in (
        (lambda: result.report(ful=True), r"write report\(\)\.text\(full=True\)$"),
        (lambda: bd.simulate(tend=1.0), r"simulate\(\) got .* 'tend' \(did you mean 't_end'\?\)"),
        (
            lambda: bd.simulate(bd.scenes.serpentine(), t_end=1.0),
            r"parts of a scene: write \*scene$",
        ),
        (lambda: bd.settle(params=None, frict=True), r"'frict' \(did you mean 'friction'\?\)"),
        (lambda: bd.settle(params=None, tol=1.0), r"'tol' \(did you mean 'tolerance'\?\)"),
        (lambda: bd.Coulomb(mu_k=0.5), r"mu_k: unknown field \(did you mean 'mu'\?\)"),
        (lambda: bd.identify(fre=1), r"identify\(\) got .* 'fre' \(did you mean 'free'\?\)"),
        (
            lambda: result.report(begin=0.1),
            r"Result.report\(\) got .* 'begin'; it takes last, joint",
        ),
        (lambda: result.along_belt(nam="belt.x"), r"'nam' \(did you mean 'name'\?\)"),
        (
            lambda: bd.Pulley(0.1, 1.0),
            r"Pulley takes 0 positional argument\(s\), got 2: .* center,",
        ),
        (
            lambda: bd.Checkpoint("a", 1.0, 2),
            r"Checkpoint takes 2 positional .* got 3: .* path, every",
        ),
    ):
        with pytest.raises(TypeError, match=f"{message}"):
            call()  # type: ignore[no-untyped-call]
    assert list(inspect.signature(bd.Result.report).parameters) == ["self", "last", "joint"]
    assert pickle.loads(pickle.dumps(bd.simulate)) is bd.simulate


def test_what_notebooks_show() -> None:
    """The drive, its result, its accuracy and its modes as tables, with what print says of them."""
    params = bd.scenes.three_pulleys()[0]
    named = attrs.evolve(params.pulleys[0], name="<b>")
    params = attrs.evolve(params, pulleys=[named, *params.pulleys[1:]])
    result = bd.simulate(params, bd.Viscous([0.0] * 3), 1e-3)
    modes = bd.modes(params, bd.settle(params), n=3)
    for shown, words in (
        (params, ["belt.axial_stiffness", "stress-free length", "error of the mesh", "&lt;b&gt;"]),
        (result, ["status", "finished", "Result("]),
        (result.accuracy, ["of the mesh", "energy balance closed"]),
        (
            modes,
            ["frequency Hz", escape(modes.names[0]), f"{modes.frequency[0]:.4g}"],
        ),
    ):
        html = shown._repr_html_()
        assert html.count("<table>") == html.count("</table>") == 1
        assert "<b>" not in html
        for word in words:
            assert word in html, word


def test_texts_are_those_of_the_field() -> None:
    assert inspect.getdoc(bd.Stats.steps) == "Accepted steps."
    assert inspect.getdoc(bd.Report.end) == "Last one [s]."  # a field of its base
    assert bd.Scene.t_end.__doc__ == "End of the run [s]."
    first, *_ = inspect.getdoc(bd.Stats.error).split(". ")
    assert "root mean square" in first and len(first) < 200
    belt = bd.Belt(length=1.0, n_bodies=30, linear_density=0.1, axial_stiffness=1e4)
    assert pickle.loads(pickle.dumps(belt)) == belt

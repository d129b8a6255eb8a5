"""Help texts: the type of each argument, the meaning of each field, what functions share; errors.

attrs takes the types of arguments from converters, which take any object, and gives fields no text.
Types and texts stand once, in the class and in the section "Attributes" of its docstring. ``help``
shows every name that a class holds, and attrs leaves notes there that nothing reads again.
"""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from typing import Any, TypeVar, cast

import attrs

from .checks import close_to, unknown_field

_Class = TypeVar("_Class", bound=type)
_Function = TypeVar("_Function", bound=Callable[..., Any])

#: For ``attrs.inspect`` and for classes that are made of this one and set attributes; not
#: ``__attrs_attrs__``, which ``attrs.fields`` reads.
_NOTES = ("__attrs_props__", "__attrs_own_setattr__")
#: What belongs to another call: by the function that it is given, and how that call is written.
_ELSEWHERE = {"Result.report": {"full": "report().text(full=True)"}}
#: The names of fields or arguments and where their text begins.
_FIELD = re.compile(r"    (\*{,2}\w+(?:, \w+)*): (.*)")


def describe(cls: Any) -> None:
    """Annotate the arguments of a class with types, and its fields with texts of its docstring.

    Misspelt arguments, of its methods too, are then answered with the names that there are.
    """
    for name, one in vars(cls).copy().items():
        if inspect.isfunction(one) and not name.startswith("_"):
            setattr(cls, name, suggesting(one))
    if attrs.has(cls):
        fields = attrs.fields(cls)
        types = {one.alias: one.type for one in fields if one.init and one.type is not None}
        cls.__init__.__annotations__ = {**types, "return": None}
        cls.__init__ = suggesting(  # type: ignore[method-assign]
            cls.__init__, cls.__name__, list(types)
        )
        _give_texts(cls, [one.name for one in fields])
        for owner in filter(attrs.has, cls.__mro__):
            for name in vars(owner).keys() & set(_NOTES):
                delattr(owner, name)
    elif hasattr(cls, "_fields"):  # a NamedTuple
        types = {
            name: getattr(kind, "__forward_arg__", kind)
            for name, kind in cls.__annotations__.items()
        }
        cls.__new__.__annotations__ = types
        cls.__new__ = suggesting(cls.__new__, cls.__name__, list(types))
        texts = _texts(cls)
        for name in cls._fields:
            getattr(cls, name).__doc__ = texts.get(name)


def suggesting(function: _Function, cls: str = "", fields: Sequence[str] = ()) -> _Function:
    """Decorate a function: arguments that it does not have are answered with those that are meant.

    What makes instances of a class says of its fields.
    """
    if hasattr(function, "__wrapped__"):  # decorated already
        return function

    @wraps(function)
    def checked(*args: Any, **given: Any) -> Any:
        try:
            return function(*args, **given)
        except TypeError as error:
            began = error.__traceback__ is not None and error.__traceback__.tb_next is not None
            text = None if began else _misfit(function, args, given, cls, fields)
            if text is None:
                raise
        raise TypeError(text)

    return cast(_Function, checked)


def _misfit(
    function: Any, args: Any, given: Iterable[str], cls: str, fields: Sequence[str]
) -> str | None:
    """Describe which arguments a function does not take; None: Python's own words are best."""
    takes = inspect.signature(function).parameters
    known = fields or [name for name in takes if name != "self"]
    for name in given:
        if name not in known and cls:
            return f"{cls}.{name}: {unknown_field(name, known)}"
        if name not in known:
            elsewhere = _ELSEWHERE.get(function.__qualname__, {})
            calls = [call for other, call in elsewhere.items() if close_to(name, (other,))]
            if calls:
                return f"{function.__qualname__}() has no {name!r}: write {calls[0]}"
            hint = close_to(name, known) or f"; it takes {', '.join(known) or 'none'}"
            return f"{function.__qualname__}() got an unexpected keyword argument {name!r}{hint}"
    if not cls and args and set(getattr(args[0], "_fields", ())) & set(takes):  # a named tuple
        parts = type(args[0]).__name__.lower()
        return f"{function.__qualname__}() takes the parts of a {parts}: write *{parts}"
    most = sum(one.kind is one.POSITIONAL_OR_KEYWORD for one in takes.values()) - 1
    if not cls or len(args) - 1 <= most:  # the class or its instance is one of them
        return None
    return (
        f"{cls} takes {most} positional argument(s), got {len(args) - 1}: give the others by "
        f"name; the fields are {', '.join(known)}"
    )


def describe_all(objects: Iterable[Any]) -> None:
    """Describe the classes among public objects."""
    for one in objects:
        if isinstance(one, type):
            describe(one)


def checked(field: Any, check: Callable[[Any], Any], **metadata: Any) -> Any:
    """Return a field with a check of what it is given; None passes where it is the default."""
    optional = attrs.converters.optional(check) if field.default is None else check
    return field.evolve(converter=optional, metadata=metadata)


def quantity(unit: str, default: Any = None) -> Any:
    """Return a field with a unit; :func:`with_units` shows it, :func:`unit_of` reads it."""
    return attrs.field(default=default, metadata={"unit": unit})


def unit_of(cls: Any, field: str) -> str:
    """Return the unit of a field, "1" where it has none."""
    return str(attrs.fields_dict(cls)[field].metadata.get("unit", "1"))


def with_units(cls: _Class) -> _Class:
    """Put the units of fields into a docstring, each after the first clause of its text."""
    for field in attrs.fields(cls):
        unit = field.metadata.get("unit")
        if unit and cls.__doc__:
            clause = rf"(\n( +){field.name}: (?:.|\n(?!\2\w))*?)(?=[;:.](\s|$))"
            cls.__doc__ = re.sub(clause, rf"\1 [{unit}]", cls.__doc__, count=1)
    return cls


def listed(cls: _Class, texts: Mapping[str, str], section: str = "Attributes") -> _Class:
    """Append a section to a docstring, from a text by name."""
    _append(cls, section, texts)
    return cls


def ruled(cls: type, texts: Mapping[str, str]) -> None:
    """Append sections "Attributes", from a text by name, and "Raises" to a docstring without."""
    for name, rows in (
        ("Attributes", texts),
        ("Raises", {"TypeError, ValueError": "A field breaks its rule."}),
    ):
        if f"\n    {name}:\n" not in (cls.__doc__ or ""):
            _append(cls, name, rows)


def share_texts(function: Any, texts: Mapping[str, str]) -> None:
    """Complete a docstring by texts of arguments, and the error, that many functions have.

    What it has of its own under "Args" and "Raises" goes before these.
    """
    if function.__doc__ is None:  # Python drops them
        return
    head, *parts = re.split(r"\n\n(?=Args:\n|Raises:\n)", inspect.cleandoc(function.__doc__))
    sections = dict(one.split(":\n", 1) for one in parts)
    own = _texts(function)
    lines = [head, "", "Args:"]
    for name, one in inspect.signature(function).parameters.items():
        shown = f"**{name}" if one.kind is one.VAR_KEYWORD else name
        text = f"{shown}: {own.get(shown) or texts[name]}"
        lines += textwrap.wrap(text, 96, initial_indent=4 * " ", subsequent_indent=8 * " ")
    raises = [sections["Raises"]] if "Raises" in sections else []
    if "ValueError" not in "".join(raises):
        raises.insert(0, "    TypeError, ValueError: An argument breaks its rule.")
    function.__doc__ = "\n".join([*lines, "", "Raises:", *raises])


def _append(cls: type, section: str, texts: Mapping[str, str]) -> None:
    if cls.__doc__ is None:  # Python drops them
        return
    lines = []
    for name, text in texts.items():
        said = f"{name}: {text[:1].upper()}{text[1:]}"
        lines += textwrap.wrap(said, 100, initial_indent=8 * " ", subsequent_indent=12 * " ")
    cls.__doc__ = "\n".join([cls.__doc__.rstrip(), "", f"    {section}:", *lines, "    "])


def _give_texts(cls: Any, names: list[str]) -> None:
    """Set ``__slots__`` of a class and its bases to a mapping, in which ``inspect`` finds texts."""
    texts = _texts(cls)
    for owner in cls.__mro__:
        slots = vars(owner).get("__slots__", ())
        if any(name in texts and name in names for name in slots):
            old = slots if isinstance(slots, dict) else {}
            owner.__slots__ = {name: texts.get(name, old.get(name)) for name in slots}


def _texts(of: Any) -> dict[str, str]:
    """Read the texts of fields or arguments in a docstring; none if Python drops docstrings."""
    _, *sections = re.split(r"\n(?:Attributes|Args):\n", inspect.cleandoc(of.__doc__ or ""))
    found: dict[str, str] = {}
    names: list[str] = []
    for line in "\n".join(sections[:1]).splitlines():
        if line and not line.startswith(" "):  # the next section
            break
        field = _FIELD.fullmatch(line)
        if field:
            names = field[1].split(", ")
            found |= dict.fromkeys(names, field[2])
        else:
            for name in names:
                found[name] = f"{found[name]}\n{line.strip()}".strip()
    return found

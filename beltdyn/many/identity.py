"""Texts that identify Python values and functions by their content, in any process.

A function is known by its source, its defaults, what it encloses and what it uses of its globals,
of the user's modules as deep as they go; of installed packages by name and version. Two functions
with the same text do the same unless they read files or clocks, or change what they use. Whatever
this cannot tell, as of compiled functions, of those whose source is not at hand or that import the
user's modules when they are called, the user may name by a key.
"""

from __future__ import annotations

import ast
import copyreg
import dataclasses
import functools
import hashlib
import itertools
import linecache
import sys
import sysconfig
import types
from collections.abc import Iterable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis), range, slice)
#: What runs or imports what a text says, which only a call would tell.
_BY_TEXT = {"eval", "exec", "globals", "__import__", "import_module"}
#: Of a class: what says nothing of what it does.
_IDLE = {"__module__", "__qualname__", "__doc__", "__annotations__", "__slots__", "_abc_impl"}
_IDLE |= {"__firstlineno__", "__static_attributes__", "__annotate_func__"}
#: What a class has that makes methods of its fields, and the files that these seem to be in.
_FIELDS = {"__dataclass_fields__", "__attrs_attrs__", "_fields"}
_OF_FIELDS = ("<string>", "<attrs generated", dataclasses.__file__)
#: Methods, properties and fields of a class or an object, and what they hold.
_DESCRIPTORS = (
    *(types.MethodType, types.MemberDescriptorType, types.GetSetDescriptorType),
    *(staticmethod, classmethod, property, functools.cached_property),
)
_HELD = ("__func__", "__self__", "fget", "fset", "fdel", "func")
_Function = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda


class NoKeyError(ValueError):
    """The content of an object cannot be known, as of a compiled function."""


def token(value: Any, key: str = "") -> str:
    """Return a text of the content of a value; ``key`` stands for what cannot be known of it."""
    try:
        return _short(_Walk(key).text(value))
    except RecursionError:
        raise NoKeyError(f"{value!r:.60} is nested too deeply") from None


def _short(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:32]


def _unknown(value: Any, why: str = " from outside") -> NoKeyError:
    what = getattr(value, "__qualname__", f"{value!r:.60}")
    return NoKeyError(f"what {what} does cannot be known{why}")


class _Walk:
    """A traversal of a value; what it is in, functions and classes are called by number again."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._count = itertools.count()
        #: Numbers by id, and the objects, so that no other gets the id.
        self._met: dict[int, tuple[int, Any]] = {}

    def text(self, value: Any) -> str:
        if type(value) in _PLAIN:
            return f"{type(value).__name__} {value!r}"
        if isinstance(value, np.generic) and not isinstance(value, np.void):
            return f"{value.dtype.str} {value.tobytes().hex()}"
        if id(value) in self._met:
            return f"number {self._met[id(value)][0]}"
        number = next(self._count)
        self._met[id(value)] = number, value
        try:
            return _short(self._content(value))
        except NoKeyError:
            if not self._key:
                raise
            # of what it holds nothing has been told
            self._met = {k: one for k, one in self._met.items() if one[0] <= number}
            return f"{_named(type(value))} {getattr(value, '__qualname__', '')} {self._key!r}"
        finally:
            if not isinstance(value, (types.FunctionType, type)):
                del self._met[id(value)]

    def _all(self, values: Iterable[Any]) -> str:
        return "(" + ", ".join([self.text(one) for one in values]) + ")"

    def _content(self, value: Any) -> str:
        kind, module = type(value), getattr(value, "__module__", None) or type(value).__module__
        if kind is np.ndarray and not value.dtype.hasobject:
            data = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
            return f"array {value.dtype!r} {value.dtype.str} {value.shape} {data}"
        if kind in (list, tuple):
            return f"{kind.__name__} {self._all(value)}"
        if kind in (set, frozenset):  # their order changes from process to process
            return f"{kind.__name__} {sorted(_Walk(self._key).text(one) for one in value)}"
        if kind in (dict, types.MappingProxyType):
            keys = sorted(value, key=lambda key: _Walk(self._key).text(key))
            return f"dict {self._all(keys)} {self._all(value[key] for key in keys)}"
        if isinstance(value, types.ModuleType):
            if _is_users(value.__name__):
                raise NoKeyError(
                    f"what is used of the module {value.__name__}, which is handed on, cannot be "
                    "known: hand on what is used of it"
                )
            return f"module {_origin(value.__name__)}"
        if isinstance(value, types.FunctionType):
            return self._function(value)
        if isinstance(value, _DESCRIPTORS):
            return f"{kind.__name__} {self._all(getattr(value, one, None) for one in _HELD)}"
        if isinstance(value, type):
            return self._class(value) if _is_users(module) else _named(value)
        if isinstance(value, (types.BuiltinFunctionType, np.ufunc)):
            homes = ("numpy", "scipy.special") if isinstance(value, np.ufunc) else ()
            known = [getattr(sys.modules.get(home), value.__name__, None) for home in homes]
            if _is_users(module) or not any(one is value for one in known or [value]):
                raise _unknown(value)
            owner = getattr(value, "__self__", None)
            own = "" if owner is None or isinstance(owner, types.ModuleType) else self.text(owner)
            return f"built-in {_origin(module)} {value.__name__} {own}"
        # caches, and Numba's jit, do what is in them and nothing else
        inner = getattr(value, "py_func", None)
        if isinstance(value, functools._lru_cache_wrapper):
            inner = value.__wrapped__
        if isinstance(inner, types.FunctionType) and not _is_users(kind.__module__):
            return f"{_named(kind)} of {self.text(inner)}"
        return self._object(value, module)

    def _object(self, value: Any, module: str) -> str:
        """Return any other object as copying sees it."""
        found: Any = None
        with suppress(Exception):
            reduced = copyreg.dispatch_table.get(type(value))
            found = reduced(value) if reduced else value.__reduce_ex__(4)
        if found is None or (isinstance(found, str) and _is_users(module)):
            raise _unknown(value)
        if isinstance(found, str):
            return f"{_origin(module)} {found}"
        # how it is made, of what, its state, its items
        return self._all([type(value), *found[:3], *(list(one) for one in found[3:5] if one)])

    def _class(self, kind: type) -> str:
        """Return what a class of the user's is, but for the methods made from its fields."""
        bases = self._all([*kind.__bases__, type(kind)])
        names = {*vars(kind)} - _IDLE
        if not _FIELDS.isdisjoint(vars(kind)):
            names = {name for name in names if not _file(vars(kind)[name]).startswith(_OF_FIELDS)}
        parts = [f"{name} = {self.text(vars(kind)[name])}" for name in sorted(names)]
        return f"class {_named(kind)} {bases} {'; '.join(parts)}"

    def _function(self, function: types.FunctionType) -> str:
        try:
            cells = [cell.cell_contents for cell in function.__closure__ or ()]
        except ValueError:
            raise _unknown(function, " before what it encloses is there") from None
        own = {name: one for name, one in vars(function).items() if name != "__wrapped__"}
        # one made by a function of a package holds what that was called with
        held = self._all([function.__defaults__, function.__kwdefaults__, cells, own])
        known = function.__globals__
        home = known.get("__name__")  # wrappers call themselves as what they wrap
        if not _is_users(home):
            return f"function {_origin(home)} {function.__qualname__} {held}"
        nodes, which = _source(function)
        bodies = [node.body for node in nodes]
        body = [part for one in bodies for part in (one if isinstance(one, list) else [one])]
        _check_imports(function, body)
        source = [ast.dump(part) for part in (*(node.args for node in nodes), *body)]
        names = sorted({names for part in body for names in _dotted(part) if names[0] in known})
        used = [f"{one} {self._use(known[one[0]], one[1:])}" for one in names]
        return f"function {function.__name__} {source} {which} {held} {used}"

    def _use(self, value: Any, attributes: tuple[str, ...]) -> str:
        """Return the content of a global; of the user's modules, of what is taken of them."""
        users = isinstance(value, types.ModuleType) and _is_users(value.__name__)
        if users and attributes and attributes[0] in vars(value):
            return self._use(vars(value)[attributes[0]], attributes[1:])
        return self.text(value)


def _file(method: Any) -> str:
    code = getattr(getattr(method, "__func__", method), "__code__", None)
    return "" if code is None else str(code.co_filename)


def _source(function: types.FunctionType) -> tuple[list[_Function], int]:
    """Return the functions that begin in the line of a function, and which of these it is."""
    # The source must compile to the function: the file may have been edited since its import.
    code = function.__code__
    linecache.checkcache(code.co_filename)
    text = "".join(linecache.getlines(code.co_filename, function.__globals__))
    nodes, codes = _parsed(text, code.co_flags & annotations.compiler_flag)
    there = [one for one in codes if one.co_firstlineno == code.co_firstlineno]
    if code not in there:
        why = "has changed since it was read" if text else "is not at hand"
        raise _unknown(function, f", as its source {why}")
    return nodes[code.co_firstlineno], there.index(code)


@functools.lru_cache(maxsize=64)
def _parsed(text: str, flags: int) -> tuple[dict[int, list[_Function]], list[types.CodeType]]:
    """Return the functions of a source by their first lines, and all that they compile to."""
    nodes: dict[int, list[_Function]] = {}
    codes: list[types.CodeType] = []
    with suppress(SyntaxError):  # then it is not what was read
        tree = ast.parse(text)
        for node in ast.walk(tree):
            if isinstance(node, _Function):
                decorators: list[ast.expr] = getattr(node, "decorator_list", [])
                nodes.setdefault(min(one.lineno for one in (node, *decorators)), []).append(node)
        # as a whole, and statement by statement, as notebooks do
        for part in (tree.body, *([one] for one in tree.body)):
            codes.append(compile(ast.Module(part, []), "", "exec", flags, dont_inherit=True))
    for code in codes:  # which grows
        codes += [one for one in code.co_consts if isinstance(one, types.CodeType)]
    return nodes, codes


def _dotted(node: ast.AST, attributes: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield names, each with the attributes that are taken of it."""
    if isinstance(node, ast.Name):
        yield (node.id, *attributes)
    elif isinstance(node, ast.Attribute):
        yield from _dotted(node.value, (node.attr, *attributes))
    else:
        for one in ast.iter_child_nodes(node):
            yield from _dotted(one)


def _check_imports(function: types.FunctionType, body: Iterable[ast.AST]) -> None:
    """Refuse what imports the user's modules when it is called, or any by a text."""
    for node in itertools.chain.from_iterable(map(ast.walk, body)):
        modules: list[str] = []
        if isinstance(node, ast.Import):
            modules = [one.name for one in node.names]
        elif isinstance(node, ast.ImportFrom):
            modules = ["" if node.level else str(node.module)]
        by_text = getattr(node, "attr", getattr(node, "id", "")) in _BY_TEXT
        if by_text or any(not one or (_places(one) and _is_users(one)) for one in modules):
            why = "imports a module when it is called, or runs a text: import yours outside of"
            raise _unknown(function, f", as it {why} functions")


def _named(kind: type) -> str:
    return f"{_origin(kind.__module__)} {kind.__qualname__}"


@functools.lru_cache(maxsize=256)
def _origin(module: str) -> str:
    """Return a module by name, with the version of its package."""
    version = getattr(sys.modules.get(module.partition(".")[0]), "__version__", "")
    return f"{module} {version}" if isinstance(version, str) and version else module


def _places(module: str) -> list[str]:
    """Return the file or the folders of the package of a module; empty: there is none."""
    with suppress(ImportError, ValueError):
        spec = find_spec(module.partition(".")[0])
        if spec is not None:
            return [spec.origin] if spec.origin else [*(spec.submodule_search_locations or ())]
    return []


@functools.lru_cache(maxsize=256)
def _is_users(module: str | None) -> bool:
    """Whether a module is neither Python's nor installed."""
    top = (module or "__main__").partition(".")[0]
    if top in (*sys.stdlib_module_names, __name__.partition(".")[0]):
        return False
    installed = tuple(sysconfig.get_path(place) for place in ("purelib", "platlib"))
    return top == "__main__" or not any(
        place.startswith(installed) or {"site-packages", "dist-packages"} & {*Path(place).parts}
        for place in _places(top)
    )

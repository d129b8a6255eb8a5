"""Texts that identify Python values and functions by their content, in any process.

A function is known by its code, its defaults, what it encloses and what it uses of its globals, of
the user's modules as deep as they go; of installed packages by name and version. Two functions with
the same text do the same unless they read files or clocks, change what they use, or look names up
by a text (``getattr``). Of a function that imports the user's own modules when it is called, and of
a compiled one, this cannot be known; the user may name what it does by a key.
"""

from __future__ import annotations

import copyreg
import functools
import hashlib
import sys
import sysconfig
import types
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from opcode import opmap
from pathlib import Path
from typing import Any

import numpy as np

_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis), range, slice)
#: What imports a module by a text, which only a call would tell.
_BY_TEXT = ("__import__", "import_module")


class NoKeyError(ValueError):
    """The content of an object cannot be known, as of a compiled function."""


def token(value: Any, key: str = "") -> str:
    """Return a text of the content of a value; ``key`` stands for what cannot be known of it."""
    try:
        text = _Walk(key).text(value)
    except RecursionError:
        raise NoKeyError(f"{value!r:.60} is nested too deeply") from None
    return _short(text)


def _short(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:32]


class _Walk:
    """A traversal of a value; objects that hold themselves are named by their depth."""

    def __init__(self, key: str) -> None:
        self._key = key
        #: What the way has gone into, and where.
        self._depth: dict[int, int] = {}
        #: Texts of what it has been through; held with it, so that its id stays its own.
        self._known: dict[int, tuple[str, Any]] = {}
        self._least = sys.maxsize

    def text(self, value: Any) -> str:
        if isinstance(value, _PLAIN):
            return f"{type(value).__name__} {value!r}"
        if isinstance(value, np.generic) and not isinstance(value, np.void):
            return f"{value.dtype.str} {value.tobytes().hex()}"
        return self._once(value, lambda: self._content(value))

    def _once(self, value: Any, content: Callable[[], str]) -> str:
        if id(value) in self._known:
            return self._known[id(value)][0]
        depth = self._depth.get(id(value))
        if depth is not None:
            self._least = min(self._least, depth)
            return f"itself {depth}"
        self._depth[id(value)] = depth = len(self._depth)
        outside, self._least = self._least, sys.maxsize
        try:
            found = _short(content())
        except NoKeyError:
            if not self._key:
                raise
            found = f"{_named(type(value))} {getattr(value, '__qualname__', '')} {self._key!r}"
        finally:
            del self._depth[id(value)]
        if self._least >= depth:  # it names nothing that holds it: the same wherever it is met
            self._known[id(value)] = found, value
        self._least = min(outside, self._least if self._least < depth else sys.maxsize)
        return found

    def _content(self, value: Any) -> str:
        if isinstance(value, types.CodeType):
            return self._code(value)
        if isinstance(value, types.ModuleType):
            if _is_users(value.__name__):
                raise NoKeyError(
                    f"what is used of the module {value.__name__}, which is handed on, cannot be "
                    "known: hand on what is used of it"
                )
            return f"module {_origin(value.__name__)}"
        if type(value) is np.ndarray:  # others, as masked arrays, are objects with a state
            if value.dtype.hasobject:
                return f"objects {value.shape} {self._all(value.ravel().tolist())}"
            data = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
            return f"array {value.dtype!r} {value.dtype.str} {value.shape} {data}"
        if type(value) in (list, tuple):
            return f"{type(value).__name__} {self._all(value)}"
        if type(value) in (set, frozenset):  # their order changes from process to process
            return f"{type(value).__name__} {sorted(_Walk(self._key).text(one) for one in value)}"
        if type(value) in (dict, types.MappingProxyType):
            keys = sorted(value, key=lambda key: _Walk(self._key).text(key))
            return f"dict {self._all(keys)} {self._all(value[key] for key in keys)}"
        if isinstance(value, types.FunctionType):
            return self._function(value)
        if isinstance(value, types.MethodType):
            return f"method {self._all([value.__func__, value.__self__])}"
        if isinstance(value, np.ufunc) and not any(
            getattr(sys.modules.get(module), value.__name__, None) is value
            for module in ("numpy", "scipy.special")
        ):
            raise NoKeyError(f"what {value!r:.60} does cannot be known from outside")
        if isinstance(value, (types.BuiltinFunctionType, np.ufunc)):
            owner = getattr(value, "__self__", None)
            own = "" if owner is None or isinstance(owner, types.ModuleType) else self.text(owner)
            module = getattr(value, "__module__", None) or type(value).__module__
            return f"built-in {_origin(module)} {value.__name__} {own}"
        if isinstance(value, type):
            return self._class(value)
        if isinstance(value, functools._lru_cache_wrapper) or hasattr(value, "py_func"):
            # caches, and Numba's jit, do what is in them and nothing else
            inner = getattr(value, "py_func", None) or getattr(value, "__wrapped__", None)
            if isinstance(inner, types.FunctionType) and not _is_users(type(value).__module__):
                return f"{_named(type(value))} of {self.text(inner)}"
        return self._object(value)

    def _all(self, values: Iterable[Any]) -> str:
        return "(" + ", ".join([self.text(one) for one in values]) + ")"

    def _function(self, function: types.FunctionType) -> str:
        if not _is_users(function.__module__):
            return f"function {_origin(function.__module__)} {function.__qualname__}" + (
                # one made by a function of a package holds what that was called with
                self._held(function) if function.__closure__ or function.__defaults__ else ""
            )
        used = self._used(function.__code__, function.__globals__)
        return f"function {self._code(function.__code__)} {self._held(function)} {used}"

    def _held(self, function: types.FunctionType) -> str:
        cells: list[Any] = []
        for cell in function.__closure__ or ():
            try:
                cells.append(cell.cell_contents)
            except ValueError:  # not yet filled
                cells.append("empty")
        own = {name: one for name, one in vars(function).items() if name != "__wrapped__"}
        return self._all([function.__defaults__, function.__kwdefaults__, cells, own])

    def _used(self, code: types.CodeType, known: dict[str, Any]) -> str:
        """Return the globals that a function uses, and its uses of the user's modules."""
        names = set[str]()
        for part in _parts(code):
            names |= {*part.co_names}
            _check_imports(part, known)
        found = sorted(name for name in names if name in known)
        return "; ".join(self._use(name, known[name], sorted(names)) for name in found)

    def _use(self, name: str, value: Any, inside: Iterable[str]) -> str:
        held: list[str] = []
        if isinstance(value, types.ModuleType) and _is_users(value.__name__):
            held = [one for one in inside if one in vars(value)]
        if not held:
            return f"{name} = {self.text(value)}"
        if id(value) in self._depth:
            return f"{name} itself"
        self._depth[id(value)] = len(self._depth)
        try:
            uses = (self._use(one, vars(value)[one], inside) for one in held)
            return f"{name}: {'; '.join(uses)}"
        finally:
            del self._depth[id(value)]

    def _code(self, code: types.CodeType) -> str:
        constants = [self._constant(one) for one in code.co_consts]
        parts = code.co_code, code.co_exceptiontable, code.co_flags, code.co_names, constants
        return f"code {_short(repr((*parts, code.co_argcount, code.co_kwonlyargcount)))}"

    def _constant(self, value: Any) -> str:
        if isinstance(value, tuple):
            return str([self._constant(one) for one in value])
        if isinstance(value, frozenset):
            return str(sorted(self._constant(one) for one in value))
        return self._code(value) if isinstance(value, types.CodeType) else repr(value)

    def _class(self, kind: type) -> str:
        """Return a class by name; one of the user's, and those it is made from, by content."""
        if not _is_users(kind.__module__):
            return _named(kind)
        parts = [self.text(base) for base in kind.__bases__]
        for name, value in sorted(vars(kind).items()):
            if name == "_abc_impl":  # which classes have been found to be one of these
                continue
            if isinstance(value, (staticmethod, classmethod, property, functools.cached_property)):
                held = (getattr(value, one, None) for one in ("__func__", "fget", "func"))
                value = next(filter(None, held), None)
            if isinstance(value, types.FunctionType) or not name.startswith("__"):
                parts.append(f"{name} = {self.text(value)}" if not _is_slot(value) else name)
        return f"class {_named(kind)} {'; '.join(parts)}"

    def _object(self, value: Any) -> str:
        """Return any other object as copying sees it."""
        try:
            reduced: Any = copyreg.dispatch_table.get(type(value))
            found = reduced(value) if reduced else value.__reduce_ex__(4)
        except Exception:
            found = None
        if isinstance(found, str):
            return f"{_origin(type(value).__module__)} {found}"
        if found is None:
            raise NoKeyError(f"what {value!r:.60} does cannot be known from outside")
        maker, given, *rest = found
        state = rest[0] if rest else None
        more = [list(one) for one in rest[1:3] if one is not None]
        return f"{self.text(type(value))} {self._all([maker, given, state, *more])}"


def _is_slot(value: Any) -> bool:
    """Whether an attribute of a class is only the slot of a field."""
    return isinstance(value, (types.MemberDescriptorType, types.GetSetDescriptorType))


def _parts(code: types.CodeType) -> Iterator[types.CodeType]:
    """Yield the code of a function and of those within it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _parts(constant)


def _check_imports(code: types.CodeType, known: dict[str, Any]) -> None:
    """Refuse what imports the user's modules when it is called, or any by a text."""
    imports = opmap["IMPORT_NAME"] in code.co_code[::2]
    package = known.get("__package__")
    for name in code.co_names:
        if name in _BY_TEXT or (imports and name not in known and _is_users_module(name, package)):
            raise NoKeyError(
                f"what {code.co_qualname} does cannot be known, as it imports a module when it is "
                "called: import yours outside of functions"
            )


def _is_users_module(name: str, package: str | None) -> bool:
    """Whether a name that a function uses may be that of a module of the user's own."""
    if not name:  # from . import
        return True
    for one in (name, f"{package}.{name}") if package else (name,):
        spec = None
        with suppress(ImportError, ValueError, AttributeError):
            spec = find_spec(one)
        if spec is not None and _is_users(one, spec.origin):
            return True
    return False


def _named(kind: type) -> str:
    return f"{_origin(kind.__module__)} {kind.__qualname__}"


@functools.lru_cache(maxsize=256)
def _origin(module: str) -> str:
    """Return a module by name, with the version of its package."""
    package = sys.modules.get(module.partition(".")[0])
    version = getattr(package, "__version__", "")
    return f"{module} {version}" if isinstance(version, str) and version else module


@functools.lru_cache(maxsize=256)
def _is_users(module: str | None, file: str | None = None) -> bool:
    """Whether a module, known by its file unless imported, is neither Python's nor installed."""
    if module is None or module == "__main__" or (module not in sys.modules and file is None):
        return True
    if module.partition(".")[0] in (*sys.stdlib_module_names, __name__.partition(".")[0]):
        return False
    if file is None:
        found = sys.modules[module]
        folders = iter(getattr(found, "__path__", ()))  # a package without a file of its own
        file = getattr(found, "__file__", None) or next(folders, None)
    installed = tuple(sysconfig.get_path(place) for place in ("purelib", "platlib"))
    return (
        file is not None
        and not file.startswith(installed)
        and not {"site-packages", "dist-packages"} & {*Path(file).parts}
    )

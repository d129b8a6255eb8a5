"""Files of results and states that are damaged, crafted or of another program: named, never run."""

from __future__ import annotations

import json
import struct
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from fuzzed import EXAMPLES, fuzz
from hypothesis import strategies as st

import beltdyn as bd

N_T = 6
Arrays = dict[str, Any]


@pytest.fixture(scope="module")
def result() -> bd.Result:
    params, torque, *_ = drives.plain_scene()
    params = attrs.evolve(params, belt=attrs.evolve(params.belt, n_bodies=24))
    run = bd.simulate(params, torque, 1e-3, t_eval=np.linspace(0.0, 1e-3, N_T))
    warning = bd.RunWarning(code="mesh", text="coarse", t=0.5, where="pulley 1", accuracy=True)
    return attrs.evolve(run, warnings=(warning,))


@pytest.fixture(scope="module")
def good(result: bd.Result, tmp_path_factory: pytest.TempPathFactory) -> Arrays:
    path = tmp_path_factory.mktemp("good") / "run.npz"
    result.save(path)
    with np.load(path) as file:
        return dict(file)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.npz"


def refused(path: Path, *words: str, kind: Any = bd.Result) -> None:
    with pytest.raises(ValueError) as caught:
        kind.load(path)
    message = str(caught.value)
    assert type(caught.value) is ValueError
    assert message.startswith(f"{path} is not a saved {kind.__name__}: ")
    assert "\n" not in message and "pickle" not in message
    assert all(word in message for word in words), message


def write(path: Path, values: Arrays) -> None:
    with open(path, "wb") as file:
        np.savez(file, **values)


MISSING = object()


def with_meta(values: Arrays, where: Sequence[str], value: Any) -> Arrays:
    """With another entry in what describes the run, or without it."""
    meta = table = json.loads(str(values["meta.json"]))
    for key in where[:-1]:
        table = table[int(key) if key.isdigit() else key]
    table[where[-1]] = value
    if value is MISSING:
        del table[where[-1]]
    return values | {"meta.json": json.dumps(meta)}


def test_what_is_saved_is_loaded(result: bd.Result, good: Arrays, path: Path) -> None:
    """In exactly the file that is named, where NumPy finds it; in any byte order and layout."""
    path = path.with_suffix("")
    result.save(path)
    again = bd.Result.load(path)
    assert again.warnings == result.warnings and again.params == result.params
    assert again.stats == result.stats and again.final_state == result.final_state
    assert again.belt.x.flags.writeable, "the arrays of a result may be worked with"
    assert good["belt.x"].shape == (N_T, 24)
    held = {1: bd.PiecewiseLinear([0.0], [0.0])}
    early = bd.simulate(result.params, bd.Viscous([0.0, 0.0]), 1e-4, held, t_eval=[0.0])
    early.save(path)
    again = bd.Result.load(path)
    assert again.final_state.t == 1e-4, "not that of the last sample"
    assert again.prescribed == (result.params.pulley_names[1],)
    for state in (bd.settle(result.params), result.final_state):
        state.save(path)
        loaded = bd.State.load(path)
        assert loaded == state and loaded.residual == state.residual
        assert not any(getattr(loaded, name).flags.writeable for name in ("x", "mu", "theta"))
    changed = {key: value.astype(value.dtype.newbyteorder(">")) for key, value in good.items()}
    changed["belt.x"] = np.asfortranarray(changed["belt.x"])
    write(path, changed)
    again = bd.Result.load(path)
    np.testing.assert_array_equal(again.belt.x, result.belt.x)
    assert again.belt.x.dtype.isnative and again.message == result.message


@np.errstate(all="ignore")
@pytest.mark.filterwarnings("ignore:invalid value encountered in cast")
def test_arrays_that_do_not_fit(good: Arrays, path: Path) -> None:
    changes: list[tuple[str, Callable[[Any], Any], str]] = [
        ("t", lambda a: a[:-1], "pulleys.theta must have shape (5, 2), got (6, 2)"),
        ("t", lambda a: a[::-1], "t must be finite and non-decreasing"),
        ("t", lambda a: a * np.nan, "t must be finite and non-decreasing"),
        ("pulleys.omega", lambda a: a[:, :1], "pulleys.omega must have shape (6, 2), got (6, 1)"),
        ("pulleys.torque", lambda a: a * np.inf, "pulleys.torque must be finite"),
        ("belt.x", lambda a: a[:, :-1], "belt.x must have shape (6, 24), got (6, 23)"),
        ("belt.x", lambda a: a.astype(np.float32), "belt.x must be of type float64, got float32"),
        ("belt.x", lambda a: a.astype("U9"), "belt.x must be of type float64, got <U9"),
        ("belt.vx", lambda a: a + 1j, "belt.vx must hold numbers or text, got complex128"),
        ("belt.phi", lambda a: a.astype("S9"), "belt.phi must hold numbers or text, got |S9"),
        ("belt.y", lambda a: a.astype("M8[s]"), "belt.y must hold numbers or text"),
        ("contact.pulley", lambda a: a.astype(float), "contact.pulley must be of type int32, got"),
        ("contact.pulley", lambda a: a + 1, "contact.pulley must be from -1 to 1"),
        ("contact.pulley", lambda a: a - 1, "contact.pulley must be from -1 to 1"),
        ("energy.kinetic", lambda a: a[:1], "energy.kinetic must have shape (6,), got (1,)"),
        ("energy.residual", lambda a: a / 0, "energy.residual must be finite"),
        ("final_state.x", lambda a: a[:-1], "final_state.x must have shape (24,), got (23,)"),
        ("final_state.theta", lambda a: a * np.nan, "State.theta must be finite"),
    ]
    for name, change, words in changes:
        write(path, good | {name: change(good[name])})
        refused(path, words)


def test_arrays_that_are_missing_or_too_many(good: Arrays, path: Path) -> None:
    """A run without the ledger has none of it; forces are infinite only where a run failed."""
    for name in ("t", "belt.x", "energy.drive", "final_state.mu", "meta.json"):
        write(path, {key: value for key, value in good.items() if key != name})
        refused(path, f"{name} is missing")
    write(path, {key: value for key, value in good.items() if not key.startswith("energy.")})
    assert bd.Result.load(path).energy is None
    write(path, good | {"belt.z": np.zeros(3)})
    refused(path, "'belt.z.npy', which does not belong there")
    infinite = {name: good[name] + np.inf for name in ("energy.contact", "joints.force")}
    write(path, good | infinite)
    refused(path, "must be finite")
    failed = with_meta(with_meta(good, ["success"], False), ["status"], "failed")
    write(path, failed | infinite)
    assert np.isinf(bd.Result.load(path).joints.force).all()
    write(path, failed | {"belt.vx": good["belt.vx"] + np.inf})
    refused(path, "belt.vx must be finite")


def test_descriptions_that_are_wrong(good: Arrays, path: Path) -> None:
    wrong: list[tuple[str, Any, str]] = [
        ("format", 1, "its format is 1, this version reads 4"),
        ("format", MISSING, "meta.json.format is missing"),
        ("stats", MISSING, "meta.json.stats is missing"),
        ("success", 1, "success must be true or false, got int 1"),
        ("success", False, "success must be that of a run that finished"),
        ("status", "ok", "status must be one of finished, failed, interrupted"),
        ("status", [], "status must be a text"),
        ("message", "\ud800", "message holds invalid characters"),
        ("final_t", float("nan"), "final_t must be a finite number"),
        ("final_t", 10**400, "final_t must be a finite number"),
        ("effects", "all", "effects must be a list"),
        ("effects", [1], "effects[0] must be a text, got int 1"),
        ("stats", 3, "stats must be a table"),
        ("stats.steps", MISSING, "stats.steps is missing"),
        ("stats.a", 1, "stats holds 'a', which does not belong there"),
        ("stats.steps", 1.5, "stats.steps must be a count, got float 1.5"),
        ("stats.steps", -1, "stats.steps must be a count, got int -1"),
        ("stats.steps", True, "stats.steps must be a count, got bool True"),
        ("stats.cpu_time", None, "stats.cpu_time must be a finite number"),
        ("stats.method", 1, "stats.method must be a text"),
        ("stats.local_error", "-", "stats.local_error must be a finite number"),
        ("warnings", {}, "warnings must be a list"),
        ("warnings", [1], "warnings[0] must be a table"),
        ("warnings.0.text", MISSING, "warnings[0].text is missing"),
        ("warnings.0.accuracy", 0, "warnings[0].accuracy must be true or"),
        ("warnings.0.t", "now", "warnings[0].t must be a finite number"),
    ]
    for where, value, words in wrong:
        write(path, with_meta(good, where.split("."), value))
        refused(path, words)


def test_texts_that_are_wrong(good: Arrays, result: bd.Result, path: Path, tmp_path: Path) -> None:
    """Descriptions that are none, and parameters, which are never read from another file."""
    for content in (
        "", "[]", "1", "null", "{", '{"format": 2}', "[" * 100_000, '{"a":' * 100_000,
        '{"format": ' + "9" * 5000 + "}", np.zeros(3), np.array(["{}"]), np.array(b"{}"),
        np.frombuffer(b"\xff" * 8, "<U2").reshape(()),
    ):  # fmt: skip
        for name in ("meta.json", "params.toml"):
            write(path, good | {name: content})
            refused(path)
    toml = str(good["params.toml"])
    for old, new, words in (
        ("n_bodies = 24", "n_bodies = 30", "must have shape (6, 30), got (6, 24)"),
        ("length = 1.2", "length = -1.2", "params.toml: belt.length must be > 0"),
        ("length = 1.2", "length = " + "[" * 5000, "params.toml: not valid TOML"),
        ("n_bodies = 24", "n_bodies = 0x" + "f" * 9000, "params.toml: belt.n_bodies must be an"),
        (toml, str(tmp_path / "drive.toml"), "params.toml: not valid TOML"),
    ):
        assert old in toml
        result.params.to_toml(tmp_path / "drive.toml")
        write(path, good | {"params.toml": toml.replace(old, new)})
        refused(path, words)


def npy(header: str, data: bytes = b"", version: bytes = b"\x01\x00") -> bytes:
    return b"\x93NUMPY" + version + struct.pack("<H", len(header)) + header.encode("latin1") + data


def described(shape: str, kind: str = "<f8") -> str:
    return f"{{'descr': {kind!r}, 'fortran_order': False, 'shape': {shape}, }}\n"


#: What a header says of the shape and type, and how many bytes follow.
ARRAYS = [
    ("(1000000000000,)", "<f8", 0), ("(1000000, 1000000, 1000000)", "<f8", 64), ("(-1,)", "<f8", 0),
    (f"({10**30},)", "<f8", 0), ("(-2, -3)", "<f8", 48), ("(0, 1000000000000)", "<f8", 8),
    ("(2,)", "<U1000000000", 8), ("(1,)", "V8", 8), ("()", "<f16", 8), ("(1,)", "nonsense", 8),
    ("(1,)", "<f8", 7), ("(1,)", "<f8", 9),
]  # fmt: skip
HEADERS = ["-" * 9000 + "1", "(" * 9000, "[" * 90 + "]" * 90, "__import__('os')", "{}"]
CRAFTED = [npy(described(shape, kind), bytes(size)) for shape, kind, size in ARRAYS]
CRAFTED += [npy(described("(1,)"), bytes(8), version) for version in (b"\x03\x00", b"\x09\x00")]
CRAFTED += [npy(described("(1,)", "O"), b"\x80\x04N."), b"", b"\x93NUMPY", b"\x80\x04N."]
CRAFTED += [npy(header) for header in HEADERS]


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_archives_that_are_crafted(path: Path) -> None:
    def archive(name: str, *contents: bytes, method: int = zipfile.ZIP_STORED) -> None:
        with zipfile.ZipFile(path, "w", method) as archive:
            for content in contents:
                archive.writestr(f"{name}.npy", content)

    for member in CRAFTED:
        for kind, name in ((bd.Result, "t"), (bd.State, "x")):
            archive(name, member)
            refused(path, name, kind=kind)
    for method in (zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        archive("x", npy(described("(9000,)"), bytes(72_000)), method=method)
        refused(path, "x is compressed", kind=bd.State)
    archive("x", *2 * [npy(described("(1,)"), bytes(8))])
    refused(path, "'x.npy', which does not belong there", kind=bd.State)


def state_of(good: Arrays) -> Arrays:
    return {name.removeprefix("final_state."): v for name, v in good.items() if "final" in name}


def test_one_place_for_many_members(good: Arrays, path: Path) -> None:
    """Entries that share their bytes could ask for many times the size of the file."""
    write(path, state_of(good) | {"x": np.zeros(100_000)})
    with zipfile.ZipFile(path, "a") as archive:
        one = archive.getinfo("x.npy")
        for info in archive.infolist():
            info.header_offset = one.header_offset
            info.file_size = info.compress_size = one.file_size
        archive._didModify = True  # type: ignore[attr-defined]
    refused(path, "its members claim to be larger than the file", kind=bd.State)


def test_what_is_no_file_of_a_run(good: Arrays, path: Path, tmp_path: Path) -> None:
    """Not readable, of another program, cut, or with a bit flipped that its check sum finds."""
    (tmp_path / "text.npz").write_text("hello\n")
    np.savez(tmp_path / "other.npz", a=1)
    np.save(tmp_path / "array.npy", np.zeros(3))
    write(path, good)
    content = bytearray(path.read_bytes())
    (tmp_path / "cut.npz").write_bytes(content[:3000])
    for kind in (bd.Result, bd.State):
        with pytest.raises(FileNotFoundError):
            kind.load(tmp_path / "none.npz")
        with pytest.raises(IsADirectoryError):
            kind.load(tmp_path)
        for name in ("text.npz", "other.npz", "array.npy", "cut.npz", "/dev/null"):
            refused(tmp_path / name, kind=kind)
    content[content.find(good["belt.x"].tobytes()) + 100] ^= 1
    path.write_bytes(content)
    refused(path, "Bad CRC-32 for file 'belt.x.npy'")


def only_documented(path: Path) -> None:
    for kind in (bd.Result, bd.State):
        try:
            kind.load(path)
        except ValueError as error:
            assert type(error) is ValueError
            assert str(error).startswith(f"{path} is not a saved {kind.__name__}: ")


@EXAMPLES
def test_any_bytes_and_any_header(examples: int, path: Path) -> None:
    def check(content: bytes) -> None:
        path.write_bytes(content)
        only_documented(path)

    def check_header(header: str, body: bytes) -> None:
        with zipfile.ZipFile(path, "w") as archive:
            for name in ("x.npy", "t.npy"):
                archive.writestr(name, npy(header, body))
        only_documented(path)

    fuzz(examples, check, st.binary(max_size=400))
    shapes = st.lists(st.integers(-3, 2**70), max_size=4).map(tuple).map(str) | st.text("(),1a")
    kinds = st.sampled_from(["<f8", ">f8", "<i4", "O", "<U4", "V3", "f4,f8", "<M8[s]", "?", "S"])
    headers = st.text(st.characters(max_codepoint=255), max_size=80)
    headers |= st.builds(described, shapes, kinds)
    fuzz(examples, check_header, headers, st.binary(max_size=64))


@EXAMPLES
def test_any_bytes_within_a_good_file(examples: int, good: Arrays, path: Path) -> None:
    whole = []
    for values in (good, state_of(good) | {"t": np.float64(0.0)}):
        write(path, values)
        whole.append(path.read_bytes())

    def check(data: st.DataObject) -> None:
        content = bytearray(data.draw(st.sampled_from(whole)))
        # the directory at the end, the heads of members and the rest are as likely
        last = len(content) - 1
        places = st.integers(max(last - 3000, 0), last) | st.integers(0, 200) | st.integers(0, last)
        for _ in range(data.draw(st.integers(1, 6))):
            content[data.draw(places)] = data.draw(st.integers(0, 255))
        if data.draw(st.booleans()):
            del content[data.draw(places) :]
        path.write_bytes(content)
        only_documented(path)

    fuzz(examples, check, st.data())


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=8,
)


@EXAMPLES
def test_any_description(examples: int, good: Arrays, path: Path) -> None:
    meta = json.loads(str(good["meta.json"]))
    tables = [([], meta), (["stats"], meta["stats"]), (["warnings", "0"], meta["warnings"][0])]

    def check(data: st.DataObject) -> None:
        where, table = data.draw(st.sampled_from(tables))
        key = data.draw(st.sampled_from(sorted(table)) | st.text(max_size=5))
        write(path, with_meta(good, [*where, key], data.draw(JSON)))
        only_documented(path)

    fuzz(examples, check, st.data())

"""Files of blocks: whatever is cut off, damaged or exchanged, what is read is what was written, up
to some complete write.
"""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from beltdyn.base.blocks import BlockFile

MARK = b"mark\n"
#: What is written at once.
WRITES = [
    [(b"rows", b"abc"), (b"last", b"")],
    [(b"last", b"x" * 40)],
    [(b"rows", b""), (b"rows", b"\x00" * 70), (b"last", b"end")],
]
WHOLE = [(b"head", b"the head"), *(block for write in WRITES for block in write)]


def opened(path: Path, write: bool = False) -> BlockFile:
    return BlockFile(path, MARK, b"last", write=write)


def append(file: BlockFile, blocks: list[tuple[bytes, bytes]]) -> None:
    """In two pieces each."""
    file.append((kind, [memoryview(held[:2]), memoryview(held[2:])]) for kind, held in blocks)


def read(path: Path) -> list[tuple[bytes, bytes]]:
    """The blocks that are read; none of what is no such file."""
    try:
        with opened(path) as file:
            return [(block.kind, file.content(block)) for block in file.blocks]
    except ValueError:
        return []


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "file"
    BlockFile.create(path, MARK, *WHOLE[0])
    for write in WRITES:
        with opened(path, write=True) as file:
            append(file, write)
    return path


#: What may be read of a damaged file.
BEGINNINGS = [WHOLE[: 1 + sum(map(len, WRITES[:k]))] for k in range(len(WRITES) + 1)]


def test_what_is_written_is_read(path: Path) -> None:
    """While another writes, which only one may."""
    with opened(path, write=True):
        assert read(path) == WHOLE
        with pytest.raises(BlockingIOError, match="another run is writing to it"):
            opened(path, write=True)
    with opened(path) as file:
        assert file.cut == 0
        out = memoryview(bytearray(5))
        file.read_into(file.blocks[5], 3, out)
        assert bytes(out) == bytes(5)
        with pytest.raises(ValueError, match="has no byte 72"):
            file.read_into(file.blocks[5], 68, out)


def test_cut_at_every_length(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The later the cut, the more is there; what is appended then continues it."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)
    whole, other, counts = path.read_bytes(), tmp_path / "cut", []
    for length in range(len(whole) + 1):
        other.write_bytes(whole[:length])
        found = read(other)
        counts.append(len(found))
        if found:
            assert found in BEGINNINGS
            with opened(other, write=True) as file:
                append(file, WRITES[0])
            assert read(other) == found + WRITES[0]
    assert counts == sorted(counts) and set(counts) == {0, *map(len, BEGINNINGS)}


def test_every_bit_flipped(path: Path, tmp_path: Path) -> None:
    """Of each byte one."""
    whole, other = path.read_bytes(), tmp_path / "flipped"
    for at in range(len(whole)):
        damaged = bytearray(whole)
        damaged[at] ^= 1 << 3 * at % 8
        other.write_bytes(damaged)
        assert read(other) in [[], *BEGINNINGS[:-1]]  # never all of it


def test_blocks_left_out_or_exchanged_do_not_count(path: Path, tmp_path: Path) -> None:
    """Each block alone is whole; their check sums are chained."""
    whole, other = path.read_bytes(), tmp_path / "other"
    with opened(path) as file:
        second = file.blocks[3]
    begin, end = second.begin - 12, second.begin + second.size + 32
    for content in (whole[:begin] + whole[end:], whole[:end] + whole[begin:end] + whole[end:]):
        other.write_bytes(content)
        assert read(other) in BEGINNINGS[1:3]
    BlockFile.create(other, MARK, b"head", b"another head")
    other.write_bytes(other.read_bytes() + whole[len(MARK) + 12 + 8 + 32 :])
    assert read(other) == [(b"head", b"another head")]


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "full"), KeyboardInterrupt()])
def test_a_write_that_fails_anywhere_changes_nothing(
    path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    """After as many bytes as can be; and the next one succeeds."""
    whole, left = path.read_bytes(), 0
    real: Any = BlockFile._write
    new = [(b"rows", b"0123456789"), (b"last", b"")]

    def write(self: BlockFile, view: memoryview) -> None:
        nonlocal left
        real(self, view[:left])
        if view.nbytes > left:
            raise error
        left -= view.nbytes

    monkeypatch.setattr(BlockFile, "_write", write)
    with opened(path, write=True) as file:
        for room in range(10 + 2 * (12 + 32)):
            left = room
            with pytest.raises(type(error)):
                append(file, new)
            assert path.read_bytes()[: len(whole)] == whole and read(path) == WHOLE
            if isinstance(error, OSError):
                assert path.stat().st_size == len(whole)  # room for others
        monkeypatch.undo()
        append(file, new)
    assert read(path) == WHOLE + new


def test_what_is_no_such_file(tmp_path: Path) -> None:
    path = tmp_path / "file"
    for content in (b"", MARK, b"something else", MARK + b"\xff" * 100):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="begin"):
            opened(path)
    with pytest.raises(IsADirectoryError):
        opened(tmp_path)
    with pytest.raises(FileNotFoundError):
        opened(tmp_path / "none")
    if os.path.exists("/dev/null"):
        with pytest.raises(OSError, match="not a regular file"):
            opened(Path("/dev/null"))

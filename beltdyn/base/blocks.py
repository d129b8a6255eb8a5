"""Files that only grow, of blocks with check sums: they survive the death of the process.

A file is the mark of its kind and blocks; a block is its kind, its length, its content and the
SHA-256 of these and of the check sum before it, so that no block can be damaged, exchanged, left
out or come from another file unseen. What is appended together ends with a block that completes
it. Blocks after the last one that completes something are those of a write that was cut off, by the
death of the process, a full disk or a power failure: readers do not see them, and the next write
replaces them.
"""

from __future__ import annotations

import errno
import hashlib
import os
import stat
import struct
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import BinaryIO, NamedTuple, Self

from . import files

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["Block", "BlockFile"]

_HEAD = struct.Struct("<4sQ")  # kind, length of the content
_SUM = hashlib.sha256().digest_size
_PIECE = 1 << 20  # read at once [byte]


class Block(NamedTuple):
    """Place of the content of a block in its file."""

    kind: bytes
    begin: int
    size: int


class BlockFile:
    """A file of blocks, open; close it, or use it in a ``with``.

    Attributes:
        blocks: Those that count, the first one first.
        cut: Bytes after them, of a write that was cut off or of damage [byte].
    """

    def __init__(
        self, path: str | os.PathLike[str], mark: bytes, completing: bytes, write: bool
    ) -> None:
        """Open a file and find its complete blocks.

        Args:
            path: Where it is.
            mark: What it begins with.
            completing: The kind of block that completes what was appended; the first block of a
                file does so whatever its kind.
            write: Whether to append to it. It is then kept from other processes, where the system
                can do so.

        Raises:
            OSError: It cannot be opened, or is not a regular file.
            BlockingIOError: Another process has it open to write.
            ValueError: It has not that mark, or its first block is not whole.
        """
        self.path = os.fspath(path)
        self._mark, self._completing = mark, completing
        self._file: BinaryIO = open(path, "r+b" if write else "rb", buffering=0)  # noqa: SIM115
        try:
            status = os.fstat(self._file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise OSError(errno.EINVAL, "it is not a regular file", self.path)
            if write:
                self._lock()
            self.blocks: list[Block] = []
            self._end, self._sum = len(mark), b""
            self._scan(status.st_size)
        except BaseException:
            self._file.close()
            raise
        self.cut = status.st_size - self._end

    @staticmethod
    def create(path: str | os.PathLike[str], mark: bytes, kind: bytes, content: bytes) -> None:
        """Make a file with its first block, in one step.

        Raises:
            OSError: It cannot be written.
        """
        head = _HEAD.pack(kind, len(content))
        digest = hashlib.sha256(mark + head + content).digest()
        files.write_bytes(path, mark + head + content + digest)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close it, which lets other processes write to it."""
        self._file.close()

    def append(self, blocks: Iterable[tuple[bytes, Sequence[memoryview]]]) -> None:
        """Append blocks, given as kind and pieces of their content; the last one completes them.

        When it returns they are on the disk. Should it raise, Ctrl-C included, none of them counts.

        Raises:
            OSError: They cannot be written, as when the disk is full.
        """
        # Whatever an earlier write left behind is taken away first, or it could be taken for the
        # rest of this one.
        self._file.truncate(self._end)
        self._file.seek(self._end)
        digest, new = self._sum, []
        try:
            for kind, pieces in blocks:
                views = [piece.cast("B") for piece in pieces if piece.nbytes]
                head = _HEAD.pack(kind, sum(view.nbytes for view in views))
                running = hashlib.sha256(digest + head)
                self._write(memoryview(head))
                begin = self._file.tell()
                for view in views:
                    running.update(view)
                    self._write(view)
                new.append(Block(kind, begin, self._file.tell() - begin))
                digest = running.digest()
                self._write(memoryview(digest))
            end = self._file.tell()
            os.fsync(self._file.fileno())
        except OSError:
            with suppress(OSError):  # room for others; readers do not need it
                self._file.truncate(self._end)
            raise
        self._end, self._sum = end, digest
        self.blocks += new

    def content(self, block: Block) -> bytes:
        """Read a block whose content is small.

        Raises:
            OSError: It cannot be read, or the file has become shorter.
        """
        content = bytearray(block.size)
        self.read_into(block, 0, memoryview(content))
        return bytes(content)

    def read_into(self, block: Block, offset: int, out: memoryview) -> None:
        """Fill a buffer from some place of a block on.

        Raises:
            OSError: It cannot be read, or the file has become shorter.
        """
        if offset + out.nbytes > block.size:
            raise ValueError(f"a block of {block.size} bytes has no byte {offset + out.nbytes - 1}")
        self._file.seek(block.begin + offset)
        bytes_of = out.cast("B")
        done = 0
        while done < bytes_of.nbytes:
            got = self._file.readinto(bytes_of[done:])  # type: ignore[attr-defined]
            if not got:
                raise OSError(errno.EIO, "it has become shorter while it was read", self.path)
            done += got

    # --- reading which blocks are whole -----------------------------------------------------------

    def _scan(self, size: int) -> None:
        if self._file.read(len(self._mark)) != self._mark:
            raise ValueError("or one of another version: it begins otherwise")
        digest, at, waiting = self._mark, self._end, list[Block]()
        while found := self._whole(at, size, digest):
            block, digest = found
            at = block.begin + block.size + _SUM
            waiting.append(block)
            if not self.blocks or block.kind == self._completing:
                self.blocks += waiting
                waiting.clear()
                self._end, self._sum = at, digest
        if not self.blocks:
            raise ValueError("or its beginning is damaged")

    def _whole(self, at: int, size: int, digest: bytes) -> tuple[Block, bytes] | None:
        """Return the block that begins there and its check sum; None if there is none."""
        begin = at + _HEAD.size
        if begin + _SUM > size:
            return None
        self._file.seek(at)
        head = self._read(_HEAD.size)
        kind, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (b"", size)
        if length > size - begin - _SUM:
            return None
        running = hashlib.sha256(digest + head)
        for piece in self._pieces(length):
            running.update(piece)
        if self._read(_SUM) != running.digest():
            return None
        return Block(kind, begin, length), running.digest()

    def _pieces(self, length: int) -> Iterator[bytes]:
        while length > 0:
            piece = self._read(min(length, _PIECE))
            if not piece:
                return
            yield piece
            length -= len(piece)

    def _read(self, size: int) -> bytes:
        """Read so many bytes, or less at the end of the file."""
        content = b""
        while len(content) < size:
            piece = self._file.read(size - len(content))
            if not piece:
                break
            content += piece
        return content

    # --- the system -------------------------------------------------------------------------------

    def _write(self, view: memoryview) -> None:
        while view.nbytes:
            view = view[self._file.write(view) :]

    def _lock(self) -> None:
        """Keep other processes from writing; the system ends this with the process."""
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BlockingIOError(
                errno.EWOULDBLOCK, "another run is writing to it", self.path
            ) from None
        except OSError:  # a file system without locks
            return

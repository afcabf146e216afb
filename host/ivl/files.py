"""The one writer of files: what was there stays until the new content is whole and on the disk.

files.write(path, content)          bytes or text
files.write_new(path, content)      the same, but only where nothing is
with files.replacing(path) as part: a library writes to `part`, which has the suffix of `path`

A new file has a temporary name of its own, in the same folder, made so that nobody can have put a link there. It is
flushed to the disk and then renamed. A link named like the output is replaced, not followed. What is not a file but a
device (`/dev/stdout`) is written to.
"""

import errno
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ivl.errors import ConfigError

_LEFTOVER = re.compile(r"\.ivl-[0-9a-f]{16}\.part(\.\w+)?")
_ADVICE = {
    errno.ENOSPC: "make room there",
    errno.EDQUOT: "make room there",
    errno.EROFS: "choose another place with --out",
    errno.EACCES: "choose another place with --out",
    errno.EIO: "look at the disk",
    errno.ENAMETOOLONG: "choose a shorter name",
}


def reason(error: OSError) -> str:
    """What went wrong with a file, in words, and what to do about it."""
    text = (error.strerror or str(error) or type(error).__name__).rstrip(".")
    advice = _ADVICE.get(error.errno or 0)
    return f"{text} ({advice})" if advice else text


def is_leftover(name: str) -> bool:
    """Whether this is a temporary file of a writer that was killed."""
    return _LEFTOVER.fullmatch(name) is not None


def write(path: Path, content: bytes | str) -> None:
    """Write a file so that it is there whole or not at all, and on the disk when this returns.

    Raises:
        OSError: It cannot be written; what was there is as it was.
    """
    data = content.encode() if isinstance(content, str) else content
    with replacing(path) as part, part.open("wb") as file:
        file.write(data)


def write_new(path: Path, content: bytes | str) -> None:
    """Write a file of which nothing is there yet.

    Raises:
        ConfigError: Something of this name is there.
        OSError: It cannot be written.
    """
    if path.exists():
        raise ConfigError(f"{path}: is there already; choose another name, or remove it")
    write(path, content)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary file beside `path`, which takes its place when the block ends without an exception.

    Raises:
        OSError: It cannot be written; what was there is as it was.
    """
    if _is_device(path):
        yield path
        return
    part = path.with_name(f".ivl-{secrets.token_hex(8)}.part{path.suffix}")
    try:
        os.close(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666))
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error  # the temporary name means nothing to people
    try:
        yield part
        _flush(part)
        part.replace(path)
    except BaseException:
        with suppress(OSError):
            part.unlink()
        raise
    _flush(path.parent)


def _is_device(path: Path) -> bool:
    folder = str(path.parent.absolute())
    if folder in ("/dev", "/proc") or folder.startswith(("/dev/", "/proc/")):
        return not folder.startswith("/dev/shm")
    return path.exists() and not path.is_file() and not path.is_dir()


def _flush(path: Path) -> None:
    """Bring a file, or the names in a folder, onto the disk."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # a file system that cannot flush a folder
            raise
    finally:
        os.close(descriptor)

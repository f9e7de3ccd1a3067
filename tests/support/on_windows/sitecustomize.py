"""Take from uavgram, in this process, what Windows does not have. For tests on Linux.

A process loads this when it starts, if this folder is on its PYTHONPATH; so do the processes that
it starts. `windows_desk` runs commands so.

* For uavgram's own code `sys.platform` is win32, and the POSIX-only names of `os`, `signal`,
  `socket` and `time` and modules such as `fcntl` are not there; msvcrt is. Other packages are Linux
  builds, and see Linux.
* No file is replaced, moved or removed while this process has it open, nor one in a moved folder,
  nor a file in ELSEWHERE, which stands for another program. Nothing is renamed over a file.
* uavgram opens no folder, and no file by `os.open` without O_BINARY.
* No file is made with a name of a device, a character of which Windows has its own view, or a path
  of 260 letters or more.
* uavgram opens no text file without naming its encoding.
"""

from __future__ import annotations

import builtins
import errno
import fcntl
import os
import signal
import socket
import stat
import sys
import time
import types
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

PACKAGE = os.environ["UAVGRAM_PACKAGE"] + os.sep
ELSEWHERE = "UAVGRAM_OPEN_ELSEWHERE"
MOST_LETTERS = 259
BINARY = 0o100000  # a flag that does nothing on Linux

MODULES = frozenset("fcntl resource pwd grp spwd termios tty pty posix syslog readline".split())
OS = frozenset(
    """
    pread pwrite preadv pwritev fdatasync killpg getpgrp getpgid setpgid setpgrp setsid getsid fork
    forkpty getuid geteuid getgid getegid getgroups getresuid setuid setgid chown fchown lchown
    fchmod fchdir chroot mkfifo mknod openpty posix_fallocate posix_fadvise posix_spawn posix_spawnp
    sched_getaffinity sched_setaffinity sched_yield sysconf sysconf_names confstr pathconf fpathconf
    statvfs fstatvfs sync uname getloadavg nice wait wait3 wait4 waitid WNOHANG WIFSIGNALED WTERMSIG
    WIFEXITED WEXITSTATUS ttyname tcgetpgrp ctermid pipe2 sendfile memfd_create getpriority
    register_at_fork copy_file_range eventfd splice lockf set_blocking O_NOFOLLOW O_CLOEXEC
    O_NONBLOCK O_DIRECTORY O_SYNC O_DSYNC O_NOCTTY O_NDELAY O_TMPFILE
    """.split()
)
SIGNALS = frozenset(
    """
    SIGKILL SIGHUP SIGQUIT SIGALRM SIGCHLD SIGUSR1 SIGUSR2 SIGPIPE SIGSTOP SIGTSTP SIGCONT SIGTTIN
    SIGTTOU SIGBUS SIGWINCH SIG_BLOCK SIG_SETMASK SIG_UNBLOCK pthread_sigmask pthread_kill sigwait
    sigpending setitimer getitimer alarm pause siginterrupt
    """.split()
)
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{s}{k}" for s in ("COM", "LPT") for k in range(1, 10))}
NO_LETTERS = frozenset('<>:"|?*\\')


def ours(depth: int) -> bool:
    """Return whether the code that many calls above is of the package."""
    try:
        return sys._getframe(depth + 1).f_code.co_filename.startswith(PACKAGE)
    except ValueError:  # called by no Python code
        return False


def impoverish(
    module: types.ModuleType, gone: frozenset[str], instead: Mapping[str, object] | None = None
) -> None:
    """Take names from a module, or give them other values, for the package alone."""
    other = instead or {}

    class Poor(types.ModuleType):
        def __getattribute__(self, name: str) -> Any:  # noqa: ANN401
            if (name in gone or name in other) and ours(1):
                if name in other:
                    return other[name]
                raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
            return super().__getattribute__(name)

    module.__class__ = Poor


def locking(handle: int, mode: int, count: int) -> None:
    """Lock bytes at the file's position, as ``msvcrt.locking`` does (with ``flock``)."""
    if (mode, count) != (2, 1):
        raise NotImplementedError
    if os.lseek(handle, 0, os.SEEK_CUR) < os.fstat(handle).st_size:
        raise AssertionError("locks bytes that others want to read")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as fault:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES)) from fault


MSVCRT = types.ModuleType("msvcrt")
vars(MSVCRT).update(locking=locking, LK_UNLCK=0, LK_NBLCK=2)
real_import = builtins.__import__


def poor_import(name: str, *arguments: Any, **more: Any) -> types.ModuleType:  # noqa: ANN401
    """Import as on Windows."""
    if ours(1):
        if name == "msvcrt":
            return MSVCRT
        if name.partition(".")[0] in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return real_import(name, *arguments, **more)


def open_here() -> dict[tuple[int, int], str]:
    """Device and inode, and path, of every file that this process has open or mapped."""
    found = {}
    for number in os.listdir("/proc/self/fd"):
        try:
            status = os.stat(f"/proc/self/fd/{number}")
            if stat.S_ISREG(status.st_mode):
                path = os.readlink(f"/proc/self/fd/{number}")
                found[status.st_dev, status.st_ino] = path
        except OSError:
            continue
    with open("/proc/self/maps", encoding="utf-8") as lines:
        for line in lines:
            cells = line.split(maxsplit=5)
            if len(cells) == 6 and cells[4] != "0":
                major, minor = (int(half, 16) for half in cells[3].split(":"))
                found[os.makedev(major, minor), int(cells[4])] = cells[5].rstrip("\n")
    for path in filter(None, os.environ.get(ELSEWHERE, "").split(os.pathsep)):
        if os.path.exists(path):
            status = os.stat(path)
            found[status.st_dev, status.st_ino] = path
    return found


def refuse_open(path: object, folder: int, other: object = None) -> None:
    """Refuse to move or remove what is open, or holds what is open."""
    name = os.fspath(path)  # type: ignore[call-overload]
    if folder >= 0:
        name = os.path.join(os.readlink(f"/proc/self/fd/{folder}"), os.fsdecode(name))
    name = os.path.abspath(os.fsdecode(name))
    try:
        status = os.lstat(name)
    except OSError:
        return
    held = open_here()
    below = name + os.sep
    if (status.st_dev, status.st_ino) in held or any(
        one.startswith(below) for one in held.values()
    ):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path, None, other)


def refuse_name(path: object) -> None:
    """Refuse to make a file whose name Windows does not take."""
    if not isinstance(path, str | bytes | os.PathLike):
        return
    name = os.path.abspath(os.fsdecode(path))
    if name.startswith(("/dev/", "/proc/")):
        return
    if len(name) > MOST_LETTERS:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)
    for part in name.split(os.sep):
        if NO_LETTERS & set(part) or part.partition(".")[0].upper() in DEVICES:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL), path)


def watch(event: str, arguments: Sequence[Any]) -> None:
    """Refuse what Windows refuses (an audit hook, see PEP 578)."""
    if event == "open":
        path, mode, flags = arguments
        if ours(1) and isinstance(path, str | os.PathLike):
            name = os.fspath(path)
            if name.startswith("/proc/"):
                raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)
            if os.path.isdir(name):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)
            if mode is None and not flags & BINARY and name != os.devnull:
                raise AssertionError(f"{path} is opened without O_BINARY")
        if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            refuse_name(path)
    elif event == "os.mkdir":
        refuse_name(arguments[0])
    elif event == "os.rename":
        source, target, of_source, of_target = arguments
        refuse_name(target)
        refuse_open(source, of_source, target)
        refuse_open(target, of_target, target)
    elif event == "os.remove":
        refuse_open(*arguments)


def rename(source: Any, target: Any, **more: Any) -> None:  # noqa: ANN401
    """Rename, but over nothing."""
    if os.path.lexists(target):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), source, None, target)
    os.replace(source, target, **more)


vars(os)["rename"] = rename
impoverish(os, OS, {"name": "nt", "O_BINARY": BINARY})
impoverish(sys, frozenset(), {"platform": "win32"})
impoverish(signal, SIGNALS)
impoverish(socket, frozenset({"AF_UNIX", "socketpair", "send_fds", "recv_fds"}))
impoverish(time, frozenset({"tzset", "clock_gettime", "pthread_getcpuclockid"}))
builtins.__import__ = poor_import
warnings.filterwarnings("ignore", category=EncodingWarning)
warnings.filterwarnings("error", category=EncodingWarning, module=r"uavgram(\.|$)")
sys.addaudithook(watch)

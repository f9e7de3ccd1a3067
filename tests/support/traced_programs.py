"""Programs whose connections are recorded by strace: whom do they call?"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

STRACE = shutil.which("strace")
ADDRESS = re.compile(r'inet_addr\("([\d.]+)"\)|inet_pton\(AF_INET6, "([^"]+)"')
LOOPBACK = re.compile(r"127\.|::1$|0\.0\.0\.0$|::ffff:127\.")


def strangers(folder: Path) -> list[str]:
    """Return the calls to addresses that are none of this machine's own."""
    return [
        line
        for line in (folder / "trace").read_text(errors="replace").splitlines()
        for found in ADDRESS.finditer(line)
        if not LOOPBACK.match(found[1] or found[2])
    ]


def traced(folder: Path, *program: str, **environment: str) -> subprocess.Popen[str]:
    """Start a program in a folder, and record its calls there where there is strace."""
    calls = "trace=connect,sendto,sendmsg,sendmmsg"
    trace = ["-f", "--seccomp-bpf", "-qq", "-e", calls, "-o", str(folder / "trace")]
    return subprocess.Popen(
        [*([STRACE, *trace] if STRACE else ()), *program],
        env=os.environ | {"HOME": str(folder), "DISPLAY": "", "WAYLAND_DISPLAY": ""} | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=folder,
        start_new_session=True,
    )

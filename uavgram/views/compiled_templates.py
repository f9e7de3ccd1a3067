"""Templates stay compiled, where Python keeps its own modules compiled.

To compile the templates of a report takes as long as to fill it in.
"""

from __future__ import annotations

import contextlib
import sys
from importlib.util import cache_from_source
from pathlib import Path

import jinja2
from jinja2.bccache import Bucket

_TEMPLATES = Path(__file__).parent / "templates"


class CompiledTemplates(jinja2.FileSystemBytecodeCache):
    """Jinja's bytecode in this package's ``__pycache__``, or wherever Python is told to have that.

    Where it cannot be written, templates are compiled each time, as modules are. Whoever can write
    there can change the modules as well, so what is read is trusted no more than they are.
    """

    def __init__(self) -> None:
        folder = Path(cache_from_source(str(_TEMPLATES / "page.py"))).parent
        super().__init__(str(folder), f"%s.jinja-{jinja2.__version__}")

    def load_bytecode(self, bucket: Bucket) -> None:
        """Take one compiled template from there, if it is there."""
        with contextlib.suppress(OSError):
            super().load_bytecode(bucket)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep one compiled template, complete or not at all."""
        if sys.dont_write_bytecode:
            return
        with contextlib.suppress(OSError):  # such as a folder that only root can write to
            Path(self.directory).mkdir(parents=True, exist_ok=True)
            super().dump_bytecode(bucket)

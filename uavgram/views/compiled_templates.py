"""Cache of compiled templates, in the folder where Python keeps its compiled modules.

Compiling the templates of a report takes as long as filling them in.
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
    """Cache of Jinja's bytecode in ``__pycache__`` of this package or below Python's cache prefix.

    If the folder cannot be written, templates are compiled each time, as modules are. A user who
    can write there can also change the modules, so the cached templates are as trustworthy as they.
    """

    def __init__(self) -> None:
        folder = Path(cache_from_source(str(_TEMPLATES / "page.py"))).parent
        super().__init__(str(folder), f"%s.jinja-{jinja2.__version__}")

    def load_bytecode(self, bucket: Bucket) -> None:
        """Load a compiled template if the cache has it."""
        with contextlib.suppress(OSError):
            super().load_bytecode(bucket)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Store a compiled template, complete or not at all."""
        if sys.dont_write_bytecode:
            return
        with contextlib.suppress(OSError):  # such as a folder that only root can write to
            Path(self.directory).mkdir(parents=True, exist_ok=True)
            super().dump_bytecode(bucket)

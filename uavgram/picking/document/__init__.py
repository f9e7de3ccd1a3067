"""The picked state, its undo and redo, and the effect of each command; no disk, no socket."""

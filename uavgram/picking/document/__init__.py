"""What has been picked, undo and redo, and what each command changes; no disk, no socket."""

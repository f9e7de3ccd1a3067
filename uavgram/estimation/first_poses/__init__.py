"""First camera poses, where the adjustment starts: by lengths, known points or the log."""

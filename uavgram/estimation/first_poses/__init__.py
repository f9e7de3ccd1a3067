"""Initial camera poses for the adjustment: from lengths, known points or the log."""

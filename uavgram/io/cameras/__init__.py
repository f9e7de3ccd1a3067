"""Camera files of other programs, and the table of drone cameras."""

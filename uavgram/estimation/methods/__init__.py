"""Poses of many single photos at once, over level ground: by points, lines, lengths or a log."""

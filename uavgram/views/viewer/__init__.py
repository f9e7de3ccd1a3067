"""The Rerun viewer as a program of its own."""

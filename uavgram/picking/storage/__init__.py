"""The journal of changes and the tables on disk; no confirmed change is lost."""

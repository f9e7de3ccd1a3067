"""The journal of changes and the tables on disk: nothing that was confirmed is lost."""

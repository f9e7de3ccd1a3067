"""The project's tables and the journal on disk: nothing confirmed is lost."""

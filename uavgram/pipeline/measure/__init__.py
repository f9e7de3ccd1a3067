"""Main job: from a project file to its results and output files."""

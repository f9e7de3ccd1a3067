"""From a project file to results: reading, the stages in their order, the outputs."""

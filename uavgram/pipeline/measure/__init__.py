"""The main job: from a project to its results."""

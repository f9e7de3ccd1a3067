"""What a folder holds that a project could use."""

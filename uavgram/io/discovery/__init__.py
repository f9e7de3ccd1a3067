"""What a folder holds that a project could use: photos, logs, poses, cameras, tables."""

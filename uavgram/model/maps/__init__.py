"""What a survey looks like on the ground: layers and rasters."""

"""Files for maps, drawings and other photogrammetry programs."""

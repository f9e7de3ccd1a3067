"""Writers of files for maps, drawings and other photogrammetry programs."""

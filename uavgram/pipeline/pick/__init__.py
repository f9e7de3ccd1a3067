"""The adjustment while picks change, and where to look next."""

"""The local page where people pick pixels and see the measurements."""

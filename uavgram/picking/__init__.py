"""The local web page on which people pick pixels and see the measurements."""

"""Which rows of any log can be believed, whatever its format."""

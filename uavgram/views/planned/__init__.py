"""Plan in words and rows of tables, shared by the field sheet and the recording."""

"""A plan in words and rows of tables, shared by the sheet for the field and the recording."""

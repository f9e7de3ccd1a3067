"""Messages of the page as checked commands, and answers as plain JSON."""

"""Messages of the page: what comes in is checked, what goes out is plain JSON."""

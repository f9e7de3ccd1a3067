"""Messages of the page to commands, every field checked; answers to plain JSON."""

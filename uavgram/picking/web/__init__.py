"""The server of the picking page: its routes, its socket, and who may come in."""

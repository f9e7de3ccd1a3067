"""The server of the picking page: routes, socket, and access control."""

"""Many surveys at once: found, measured by processes that stay, and told in one table."""

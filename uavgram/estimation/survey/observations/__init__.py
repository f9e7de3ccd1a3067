"""Terms of the likelihood that are a subject of their own."""

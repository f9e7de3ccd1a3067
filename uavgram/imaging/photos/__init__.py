"""Photos to look at: reduced, in tiles, kept while they are used."""

"""Direction to pixel and back: lens models with derivatives, and their inverse."""

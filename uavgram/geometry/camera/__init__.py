"""Projection and back-projection: lens models, their derivatives and their inverse."""

"""Views of the model types; nothing is computed here."""

"""Ground measurements with honest uncertainties from drone photos, flight logs and lengths."""

"""Why a survey does not fit: what could be wrong, tested at the stated noise."""

"""Before a flight: where to photograph from, and where reference lines may lie."""

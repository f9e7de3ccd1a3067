"""Before a flight: where to photograph from, which lines to lay, how exact it will be."""

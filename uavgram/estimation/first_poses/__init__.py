"""First values of the adjustment: from lengths, from known points, from telemetry."""

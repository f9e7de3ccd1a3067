"""The search for what is wrong: frames, lengths, control points, single observations."""

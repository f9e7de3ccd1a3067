"""Tables written by users: picks, known lengths, measurements, known points."""

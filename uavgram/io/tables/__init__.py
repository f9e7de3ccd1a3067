"""Tables that people type: picks, known lengths, measurements, known points."""

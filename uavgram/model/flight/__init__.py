"""What a flight left behind: log, photos, poses."""

"""What several photos show of the same place, found without a click: features and their matches."""

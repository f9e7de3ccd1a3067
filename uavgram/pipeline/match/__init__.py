"""Picked points found in the other photos: `uavgram picks match`."""

"""Find picked points in the other photos: `uavgram picks match`."""

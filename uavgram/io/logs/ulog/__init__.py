"""Readers of PX4's ULog: topics, samples, events."""

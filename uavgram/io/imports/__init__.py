"""Picks that were made in other programs (LabelMe, OpenDroneMap), read as ours."""

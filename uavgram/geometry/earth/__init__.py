"""Relation of the local world to the earth and to time: geodesy, map projections, GPS time."""

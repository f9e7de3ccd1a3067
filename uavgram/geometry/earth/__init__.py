"""The local world on the earth, and in time: geodesy, map projections, GPS time."""

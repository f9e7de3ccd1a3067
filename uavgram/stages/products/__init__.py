"""Products from a result: layers of maps and drawings, geotags, grids of top views."""

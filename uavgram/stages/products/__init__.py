"""What is handed on, computed: layers of maps and drawings, geotags, grids of top views."""

"""What is handed on: layers for maps and drawings, geotags, top views."""

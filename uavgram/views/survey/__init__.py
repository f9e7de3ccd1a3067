"""Views of a result in words and shapes, the same in recording, report and terminal."""

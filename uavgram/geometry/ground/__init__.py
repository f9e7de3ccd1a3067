"""The ground under the camera: where rays meet it, shapes on it, its top view."""

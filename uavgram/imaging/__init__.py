"""Image processing of photos: calibration boards, previews, top views, matching, rendering."""

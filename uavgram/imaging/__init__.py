"""Whatever looks at the pixels of photos: calibration boards, previews, top views, rendering."""

"""MAVLink telemetry logs: frames, columns, samples, events; and a writer for simulated flights."""

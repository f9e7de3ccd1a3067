"""Stage: calibrate a camera from photos of a board, with its covariance."""

from uavgram.stages.calibrate.calibration import calibrate

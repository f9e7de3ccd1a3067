"""Photos of a board to a camera with its covariance."""

from uavgram.stages.calibrate.calibrate import calibrate

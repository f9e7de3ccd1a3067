"""Stage: estimate each camera pose before any adjustment, with its covariance."""

from uavgram.stages.seed.poses import nominal_mount as nominal_mount
from uavgram.stages.seed.poses import seed as seed

"""Stage: refine poses, points and all that is shared, in one maximum-likelihood adjustment."""

from uavgram.stages.refine.refine import refine as refine

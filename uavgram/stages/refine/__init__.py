"""Stage: refine poses, points and shared unknowns in one maximum-likelihood adjustment."""

from uavgram.stages.refine.refine import refine as refine

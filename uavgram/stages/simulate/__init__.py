"""Stage: simulate a survey, errors and truth, from a scenario."""

from uavgram.stages.simulate.survey import simulate

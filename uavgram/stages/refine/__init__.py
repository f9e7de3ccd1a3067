"""Stage: refine poses, points and shared unknowns in one maximum-likelihood adjustment.

Order of reading, for the removal of outliers:

1. `refine.py`: the steps of the stage.
2. `minima.py`: the ordinary adjustment from all first values (`begin/`), and its rival minima.
3. `robust.py`, `annealing.py`: removal of gross errors by graduated non-convexity.
4. `causes/`: hypotheses that explain gross errors, tested and corrected one after the other.
5. `noise.py`, `outstanding.py`: variance components, estimated without outliers.
6. `snooping.py`: data snooping at the learnt noise.

Tie points and points off the ground: `sound_ties.py`, `near_ties.py`, `off_ground/`. Records and
messages: `left_out.py`, `remarks.py`, `noise_remarks.py`, `learnt.py`.
"""

from uavgram.stages.refine.refine import refine as refine

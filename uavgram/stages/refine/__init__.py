"""Stage: refine poses, points and shared unknowns in one maximum-likelihood adjustment.

Order of reading, for the removal of outliers:

1. `refine.py`: the steps of the stage.
2. `minima.py`: the ordinary adjustment from all first values (`first_values.py`), and its rivals.
3. `gross_errors.py`, `robust_adjustment.py`: removal of gross errors by graduated non-convexity.
4. `causes/`: hypotheses that explain gross errors, tested and corrected one after the other.
5. `noise.py`, `noise_outliers.py`: variance components, estimated without outliers.
6. `blunder_removal.py`: data snooping at the learnt noise.

Tie points and points off the ground: `tie_outliers.py`, `ground_from_ties.py`, `off_ground.py`.
Records and messages: `left_out.py`, `remarks.py`.
"""

from uavgram.stages.refine.refine import refine as refine

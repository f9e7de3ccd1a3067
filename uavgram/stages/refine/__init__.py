"""Stage: refine poses, points and shared unknowns in one maximum-likelihood adjustment.

Order of reading, for the removal of outliers:

1. `refine.py`: the steps of the stage.
2. `minima.py`: the ordinary adjustment from all first values (`first_values.py`), and its rivals.
3. `gross_errors.py`: removal of gross errors. `robust_adjustment.py`: graduated non-convexity from
   one set of first values; `robust_candidate.py`: its candidates; `reduced_starts.py` and
   `exchanged_readings.py`: other first values; `rival_errors.py`: other readings that explain as
   much; `cleaned_adjustment.py`: the adjustment without the gross errors.
4. `causes/`: hypotheses that explain gross errors, tested and corrected one after the other.
5. `noise.py`, `noise_outliers.py`: variance components, estimated without outliers.
6. `blunder_removal.py`: data snooping at the learnt noise.

Tie points and points off the ground: `tie_outliers.py`, `ground_from_ties.py`, `off_ground.py`.
Records and messages: `left_out.py`, `remarks.py`.
"""

from uavgram.stages.refine.refine import refine as refine

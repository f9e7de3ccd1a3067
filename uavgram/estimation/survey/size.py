"""What is as large as the survey itself, and so no witness of its size.

How uneven the ground is, the survey learns from its own points, and without a log how fast the
drone flew, from its own photos: in metres that the known lengths alone give. Were these twice as
long, so would be both. As priors of a fixed width they would bear on the scale nevertheless, the
smaller the survey the better they would fit; so where it is asked what bears on the scale, their
widths go with it.
"""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import kind_of
from uavgram.model.arrays import Floats


def by_size(adjustment: Adjustment) -> dict[str, Floats]:
    """How residuals change with a factor by which all that is measured comes out too long.

    Returns
    -------
    dict
        By group, (m, r) derivatives of its whitened residuals by the factor, as the widths of these
        priors and the speed go with the size of the survey: at a given departure, a width that is
        smaller by the factor makes a residual larger by it.
    """
    blocks, rolling = adjustment.minimum.blocks, adjustment.survey.rolling
    change = {kind: block.residual for kind, block in blocks.items() if kind_of(kind).by_size}
    if rolling is not None and rolling.by_photos:
        # At half the speed, rows read in twice the time show the same.
        share = rolling.readout.value_s / rolling.readout.sigma_s
        change["readout"] = np.full_like(blocks["readout"].residual, share)
    return change

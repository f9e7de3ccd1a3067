"""Coded plates are proposed without a pick: found in the background, measured in the whole photo."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest
from plate_pictures import photo_of, plate_samples, quad

from uavgram.imaging.photos.grey_photos import GreyPhotos
from uavgram.imaging.plates.families import cells_of
from uavgram.imaging.raster import Image
from uavgram.model.options import TargetOptions
from uavgram.model.survey.observations import MeasurementRequest
from uavgram.picking.document import commands as c
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.proposals import BY_HAND, Outcomes, accepted
from uavgram.picking.document.state import State
from uavgram.picking.session import plate_seeker as module
from uavgram.picking.session.plate_seeker import PlateSeeker
from uavgram.picking.session.proposed import Proposed
from uavgram.pipeline.measure.inputs import Inputs

"""Run the command line: python -m uavgram."""

import sys

from uavgram.cli import main

sys.exit(main())

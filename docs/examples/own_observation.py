"""An observation of your own: one length is known to be longer than another, by so much.

Nobody measured either of them; two pieces of string were compared. A kind of known thing says how
far points are from what is known of them, with the derivatives by the points. Once it has a name in
the table of kinds, `known.csv` may have it, and it is tested, reported and simulated like others.
"""

import shutil
from pathlib import Path

import numpy as np

import uavgram
from uavgram.estimation.survey.known_kinds import (
    ALL_KINDS,
    KNOWN_KINDS,
    AlikeThings,
    KnownKind,
    KnownResiduals,
)


class LongerBy(KnownKind):
    """The distance of the first two points less that of the last two [m]."""

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute the differences less the known ones."""
        known = np.array([thing.value for thing in alike.things])
        one = alike.world[:, 1] - alike.world[:, 0]
        other = alike.world[:, 3] - alike.world[:, 2]
        lengths = np.linalg.norm(one, axis=1), np.linalg.norm(other, axis=1)
        along, across = one / lengths[0][:, None], other / lengths[1][:, None]
        gradient = np.stack([-along, along, across, -across], axis=1)
        return KnownResiduals((lengths[0] - lengths[1] - known)[:, None], gradient[:, None])


kind = LongerBy("longer_by", shown="longer by", points=(4, 4), has_value=True)
ALL_KINDS[kind.name] = KNOWN_KINDS[kind.name] = kind

given = Path(__file__).resolve().parents[2]  # with the folders configs and logs
own = Path("uavgram-example-own-observation")
for part in ("configs", "logs"):
    leave = shutil.ignore_patterns("out")
    shutil.copytree(given / part, own / part, ignore=leave, dirs_exist_ok=True)
folder = own / "configs"
table = (folder / "known.csv").read_text(encoding="utf-8")
(folder / "own.csv").write_text(f"{table}string,longer_by,R1;R5;R3;R4,0.794,0.02,\n", "utf-8")
project = (folder / "project.yaml").read_text(encoding="utf-8")
text = project.replace("known: known.csv", "known: own.csv")
(folder / "own.yaml").write_text(text, encoding="utf-8")

result = uavgram.run(folder / "own.yaml", output=None)
known = uavgram.to_pandas(result, "known")
print(known.loc[["string"], ["kind", "value", "adjusted", "residual", "w", "redundancy", "status"]])

"""How good would it have been with fewer lengths? Withhold them, and look at what comes out."""

import shutil
from pathlib import Path

import pandas as pd

import uavgram

given = Path(__file__).resolve().parents[2]  # with the folders configs and logs
own = Path("uavgram-example-study")
for part in ("configs", "logs"):
    leave = shutil.ignore_patterns("out")
    shutil.copytree(given / part, own / part, ignore=leave, dirs_exist_ok=True)
folder = own / "configs"
lines = pd.read_csv(folder / "lines.csv")
project = (folder / "project.yaml").read_text(encoding="utf-8")
rows = []
for used in (1, 3, 5):
    lines["use"] = ["adjust" if k < used else "check" for k in range(len(lines))]
    lines.to_csv(folder / "some_lines.csv", index=False)
    text = project.replace("lines: lines.csv", "lines: some_lines.csv")
    (folder / "some_lines.yaml").write_text(text, encoding="utf-8")
    result = uavgram.run(folder / "some_lines.yaml", output=None)
    lengths = uavgram.to_pandas(result, "lines")
    withheld = lengths[lengths["status"] == "checked"]
    error = withheld["adjusted_m"] - withheld["length_m"]
    skid = result.measurements.name.index("skid")
    rows.append(
        {
            "lengths used": used,
            "sigma of the skid mark [m]": float(result.measurements.sigma[skid]),
            "withheld": len(withheld),
            "rms error of withheld [m]": float((error**2).mean() ** 0.5),
            "verdict": result.verdict.level,
        }
    )
print(pd.DataFrame(rows).round(4).to_string(index=False))

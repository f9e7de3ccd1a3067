"""Measure several surveys, and compare them in one table."""

import shutil
from pathlib import Path

import pandas as pd

from uavgram.cli import main

if __name__ == "__main__":  # batch starts processes, which import this file
    # Two surveys: the same photos with a log, and with lengths alone.
    given = Path(__file__).resolve().parents[2]  # with the folders configs and logs
    own = Path("uavgram-example-batch")
    surveys = own / "surveys"
    shutil.copytree(given / "logs", own / "logs", dirs_exist_ok=True)
    for name, project in {"log": "project.yaml", "lengths": "lengths_only.yaml"}.items():
        folder = surveys / name
        leave = shutil.ignore_patterns("out", "*.yaml")
        shutil.copytree(given / "configs", folder, ignore=leave, dirs_exist_ok=True)
        shutil.copy(given / "configs" / "camera.yaml", folder)
        text = (given / "configs" / project).read_text(encoding="utf-8")
        text = text.replace("../logs/", "../../logs/")
        (folder / "project.yaml").write_text(text, encoding="utf-8")

    # What was measured already and has not changed is left out when this is run again.
    status = main(["batch", str(surveys), "--output", str(own / "table"), "--quiet"])
    table = pd.read_csv(own / "table" / "batch.csv")
    print(status, len(table))
    print(table[["name", "status", "verdict", "mean_sigma_m", "photos", "measurements"]])

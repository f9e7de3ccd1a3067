"""Measure several surveys, and compare them in one table."""

import shutil
from pathlib import Path

import pandas as pd

from uavgram.cli import main

if __name__ == "__main__":  # batch starts processes, which import this file
    # Two surveys: the same photos with a log, and with lengths alone.
    surveys = Path("surveys")
    for name, project in {"log": "project.yaml", "lengths": "lengths_only.yaml"}.items():
        folder = surveys / name
        shutil.copytree("configs", folder, ignore=shutil.ignore_patterns("out", "*.yaml"))
        shutil.copy("configs/camera.yaml", folder)
        text = Path("configs", project).read_text(encoding="utf-8")
        text = text.replace("../logs/", "../../logs/")
        (folder / "project.yaml").write_text(text, encoding="utf-8")

    # What was measured already and has not changed is left out when this is run again.
    status = main(["batch", str(surveys), "--output", "table", "--quiet"])
    table = pd.read_csv("table/batch.csv")
    print(status, len(table))
    print(table[["name", "status", "verdict", "mean_sigma_m", "photos", "measurements"]])

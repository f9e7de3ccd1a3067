# %% [markdown]
# # A survey, step by step
#
# From a project's files to values, tables and plots. The files are in `configs` and `logs`, two
# folders above this one, as in the repository and in `uavgram-examples.zip` of the manual.
# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import uavgram
from uavgram.pipeline.measure.compute import pose_frames
from uavgram.pipeline.measure.inputs import read_inputs

here = Path(globals().get("__file__", "survey.ipynb")).resolve().parent  # a notebook has no file
PROJECT = here.parents[1] / "configs" / "project.yaml"

# %% [markdown]
# ## What was read
# %%
inputs = read_inputs(PROJECT)
print(len(inputs.picks.label), "picks of", len(set(inputs.picks.label)), "points")
print(len(inputs.lines.name), "known lengths")

# %% [markdown]
# ## Where the log has each camera, and how well it knows it
# %%
posed = pose_frames(inputs)
poses = posed.telemetry.poses
sigma_m = np.sqrt(np.diagonal(poses.covariance, axis1=1, axis2=2))[:, :3]
for place, sigma in zip(poses.center_world_m, sigma_m, strict=True):
    print("east, north, up [m]:", place.round(1), "+-", sigma.round(1))

# %% [markdown]
# ## The whole run, without writing anything
# %%
result = uavgram.run(PROJECT, output=None)
print("verdict:", result.verdict.level)
for message in result.messages:
    print(f"{message.level}: {message.code}")

# %% [markdown]
# ## Tables: one data frame for each
# %%
values = uavgram.to_pandas(result, "measurements")
values["share"] = values["sigma"] / values["value"].abs()
print(values[["kind", "value", "sigma", "unit", "status"]].round(3))

# %% [markdown]
# Values share their errors. Their correlation, and from it the sigma of a difference:
# %%
correlation = result.measurements.correlation
first, second = 0, 1
sigma = result.measurements.sigma
difference = np.sqrt(
    sigma[first] ** 2
    + sigma[second] ** 2
    - 2 * correlation[first, second] * sigma[first] * sigma[second]
)
print("sigma of the difference of the first two:", round(float(difference), 4))

# %% [markdown]
# ## Plots
# %%
figure, axes = plt.subplots(1, 3, figsize=(15, 4.5))
uavgram.plots.plan(result, axes[0])
uavgram.plots.residuals(result, axes[1])
uavgram.plots.budget(result, axes[2])
own = Path("uavgram-example-survey")
own.mkdir(exist_ok=True)
figure.savefig(own / "survey.png")

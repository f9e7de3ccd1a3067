"""Commands of `uavgram`, one file each: arguments -> one call of the pipeline."""

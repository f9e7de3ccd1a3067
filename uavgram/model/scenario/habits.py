"""What is done to a simulated survey that the program does not take for granted."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from uavgram.model.scenario.checks import require


@dataclass(frozen=True, kw_only=True)
class Raised:
    """A point that stands off the ground though nobody says so."""

    label: str
    height_m: float


@dataclass(frozen=True, kw_only=True)
class WrongLength:
    """A length whose reading is off by so much."""

    name: str
    by_m: float


@dataclass(frozen=True, kw_only=True)
class HabitSpec:
    """Errors of people, logs and cameras: exact ones, the same in each repetition.

    Attributes
    ----------
    tape_long
        Share by which all lengths are read too long.
    level_tape
        Lengths are taken with the tape held level, and written as if along the ground.
    focal_wrong
        Share by which the true focal length is longer than the calibration says.
    lag_s
        By which the log's exposures are late.
    yaw_deg, mount_deg
        By which the log's heading, and the camera's tilt in its mount, are off beside the errors.
    gps_jump_m
        Step of the logged position to the north, amid the photos.
    heavy_tails
        Share of picks that are five times as bad.
    pick_factor
        True over stated sigma of the picks.
    raised
        Points off the ground.
    swapped
        Pairs of labels that are exchanged in the first photo that shows both.
    wrong_lengths
        Readings with a blunder.
    """

    tape_long: float = 0.0
    level_tape: bool = False
    focal_wrong: float = 0.0
    lag_s: float = 0.0
    yaw_deg: float = 0.0
    mount_deg: float = 0.0
    gps_jump_m: float = 0.0
    heavy_tails: float = 0.0
    pick_factor: float = 1.0
    raised: tuple[Raised, ...] = ()
    swapped: tuple[tuple[str, str], ...] = ()
    wrong_lengths: tuple[WrongLength, ...] = ()

    def __post_init__(self) -> None:
        for name in ("tape_long", "focal_wrong"):
            require(abs(getattr(self, name)) < 0.9, f"{name} is a share: it must be below 0.9")
        require(0 <= self.heavy_tails <= 1, "heavy_tails is a share: it must lie between 0 and 1")
        require(self.pick_factor > 0, "pick_factor must be greater than 0")

    def names(self) -> tuple[str, ...]:
        """Which of them there are."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name) != f.default)

    def only(self, name: str) -> HabitSpec:
        """One of them alone."""
        return replace(HabitSpec(), **{name: getattr(self, name)})

    @property
    def labels(self) -> frozenset[str]:
        """Points that they name."""
        raised = {one.label for one in self.raised}
        return frozenset(raised | {label for pair in self.swapped for label in pair})

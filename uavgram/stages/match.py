"""Match: choose places to search in other photos, record finds, and test them for contradictions.

The search has several rounds, as more finds give better poses and smaller search regions. A round
takes the places that are predicted about as well as the best of the remaining ones. A place that
was not found is tried again from another pick, or when its search region is much smaller.

All predictions in one photo share the errors of its pose, so the errors of the finds must agree
with the joint covariance of the predictions. This test (Baarda 1968, in the linear model, for pairs
of coordinates) detects a look-alike even inside its own large search region.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated

import numpy as np
from scipy.special import chdtri, logsumexp

from uavgram.estimation.measuring.predicted_pixels import TransferredPixels
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Bools, Floats, Ints, rows_of
from uavgram.model.observations import Picks
from uavgram.stages.ground_consensus import RAISED_HEIGHTS_M

Pair = tuple[str, str]
"""Photo and label."""


CONTRADICTED = "what looks like it has moved, or is something else: the other photos contradict it"


RAISED_PX = 0.3
"""Sigma that is added to finds of points off the ground: the background of their edges differs from
photo to photo. Measured on rendered streets, clicked with 1 px noise, from the clicked places."""


def pick_sigmas(covariance_px2: Floats, is_raised: Bools) -> Floats:
    """Return sigmas (n,) of picks made from finds: those of the matching, in its worse direction.

    Parameters
    ----------
    covariance_px2
        (n, 2, 2) of the matching; NaN where nothing was found.
    is_raised
        (n,) whether the point is off the ground.
    """
    worse = np.sqrt(np.linalg.eigvalsh(np.nan_to_num(covariance_px2))[:, 1])
    return np.asarray(np.hypot(worse, np.where(is_raised, RAISED_PX, 0.0)))


@dataclass(frozen=True)
class Found:
    """Label found in a photo.

    Attributes
    ----------
    pick
        Number of the pick that it was found from.
    pixel_px
        (u, v).
    sigma_px, score
        Sigma of the matching alone, in its worse direction; and similarity of both places, 0 to 1.
    radius_px
        Half the length of the region that was searched.
    """

    pick: int
    pixel_px: tuple[float, float]
    sigma_px: float
    score: float
    radius_px: float

    def revoke(self, why: str) -> Missed:
        """Return the find as revoked."""
        return Missed(self.pick, self.radius_px, why, self.pixel_px)


@dataclass(frozen=True)
class Missed:
    """Label that was not found in a photo.

    Attributes
    ----------
    pick, radius_px
        As in `Found`.
    why
        Reason, in words.
    pixel_px
        (u, v) of a look-alike that the others contradict.
    """

    pick: int
    radius_px: float
    why: str
    pixel_px: tuple[float, float] | None = None


@dataclass(frozen=True)
class Record:
    """Record of the search so far, by photo and label.

    Attributes
    ----------
    found
        Valid finds.
    missed
        Unsuccessful attempts, in order.
    """

    found: Mapping[Pair, Found] = field(default_factory=dict)
    missed: Mapping[Pair, tuple[Missed, ...]] = field(default_factory=dict)

    def add_results(self, results: Mapping[Pair, Found | Missed]) -> Record:
        """Add the results of another round."""
        found, missed = dict(self.found), dict(self.missed)
        for pair, result in results.items():
            if isinstance(result, Found):
                found[pair] = result
            else:
                missed[pair] = (*missed.get(pair, ()), result)
        return Record(found, missed)

    def revoke_finds(self, pairs: Mapping[Pair, str]) -> Record:
        """Revoke some finds, with reasons."""
        out = {pair: self.found[pair].revoke(why) for pair, why in pairs.items()}
        rest = {pair: one for pair, one in self.found.items() if pair not in pairs}
        return replace(self, found=rest).add_results(out)

    def remove_labels(self, labels: Collection[str]) -> Record:
        """Remove some labels from the record."""
        found = {pair: one for pair, one in self.found.items() if pair[1] not in labels}
        missed = {pair: all_ for pair, all_ in self.missed.items() if pair[1] not in labels}
        return Record(found, missed)

    @property
    def in_vain(self) -> dict[Pair, str]:
        """Pairs that were not found, and the reason: contradicted, or else the last one."""
        left = {pair: tried for pair, tried in self.missed.items() if pair not in self.found}
        return {
            pair: CONTRADICTED if any(one.why == CONTRADICTED for one in tried) else tried[-1].why
            for pair, tried in left.items()
        }


@dataclass(frozen=True, kw_only=True)
class Matches:
    """Result of a search.

    Attributes
    ----------
    path
        The table of picks.
    record
        Found and missed, by photo and label.
    labels
        Labels that were looked for.
    picks
        Picks of the table after the search, or as it would be.
    replaced, kept
        Number of earlier matches whose pick was moved, or that no longer fit, and which are
        removed; and of those that stay unchanged.
    not_sought
        Labels that take no part in the adjustment, so that their places are unknown.
    unplaced
        Photos of unknown position.
    turned_rad
        Angle between the camera's direction and that by mount and log, beyond their errors; 0:
        none.
    """

    path: str
    record: Record
    labels: tuple[str, ...]
    picks: Picks
    replaced: int
    kept: int = 0
    not_sought: tuple[str, ...] = ()
    unplaced: tuple[str, ...] = ()
    turned_rad: float = 0.0

    @property
    def sightings(self) -> dict[str, int]:
        """Number of photos with each label that was looked for, in the table."""
        count = dict.fromkeys(self.labels, 0)
        for label in self.picks.label:
            if label in count:
                count[label] += 1
        return count


REGION_SQUARED = float(chdtri(2, 0.001))
"""Squared sigmas from the middle of a 99.9 % region to its edge."""

MAX_RADIUS_PX = 25.0
"""Radius of a region that is searched without waiting for better poses."""

MIN_ROUND_SHARE = 0.2
"""Least share of the remaining places that a round takes."""

SIMILAR_RADIUS = 1.5
"""Factor of the radius up to which other places are taken too."""

NARROWED_SHARE = 0.5
"""Share of its radius to which a region must have shrunk to be searched again."""


def compute_radii(covariance_px2: Floats) -> Floats:
    """Return half lengths (n,) of the 99.9 % regions of covariances (n, 2, 2) [px]."""
    return np.asarray(np.sqrt(REGION_SQUARED * np.linalg.eigvalsh(covariance_px2)[:, 1]))


def compute_stretches(affine: Floats) -> Floats:
    """Compute the change of size (n,), as a logarithm: 0 for equal size without foreshortening."""
    size = np.linalg.svd(affine, compute_uv=False)
    return np.asarray(np.abs(np.log(np.maximum(size, 1e-9))).max(axis=1))


MIN_PX = 0.5
"""Sigma that is added to every prediction [px], for errors outside the model, such as a remaining
distortion."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Set of n predicted places of picks in other photos.

    Attributes
    ----------
    places
        The predictions.
    pair
        (n,) photo and label of each.
    pick
        (n,) number of the pick that each is predicted from.
    is_raised
        (n,) whether the label is off the ground: the background of its edges changes from photo to
        photo, so it waits for the poses from ground points.
    is_alone
        (n,) whether only one photo shows such a label, so that its height is unknown.
    adjustment
        Adjustment that predicted the places; None where features did.
    """

    places: TransferredPixels
    pair: Annotated[tuple[Pair, ...], "n"]
    pick: Annotated[Ints, "n"]
    is_raised: Annotated[Bools, "n"]
    is_alone: Annotated[Bools, "n"]
    adjustment: Adjustment | None = None

    @cached_property
    def radius_px(self) -> Floats:
        """Half lengths (n,) of the 99.9 % regions of the places."""
        return compute_radii(self.places.covariance_px2)

    def select(self, rows: Ints) -> Candidates:
        """Select some places by their rows."""
        return replace(self, places=self.places.select(rows), **rows_of(self, rows))

    def holds(self, row: int, pixel_px: tuple[float, float], sigma_px: float = MIN_PX) -> bool:
        """Return whether a pixel is in the 99.9 % region of a place.

        Parameters
        ----------
        row
            The place.
        pixel_px, sigma_px
            (u, v), and its sigma.
        """
        off = np.array(pixel_px) - self.places.pixel_px[row]
        spread = self.places.covariance_px2[row] + sigma_px**2 * np.eye(2)
        return bool(off @ np.linalg.solve(spread, off) <= REGION_SQUARED)

    def list_contradicted(self, found: Mapping[int, Found]) -> list[Pair]:
        """List the finds, by the row of their place, that others in the same photo contradict."""
        if self.adjustment is None:
            return []
        wrong: list[Pair] = []
        for image in dict.fromkeys(self.pair[row][0] for row in found):
            own = {row: one for row, one in found.items() if self.pair[row][0] == image}
            rows = np.array(list(own), dtype=np.int64)
            joint = self.places.joint_covariance(self.adjustment, rows)
            off = np.array([one.pixel_px for one in own.values()]) - self.places.pixel_px[rows]
            sigma = np.hypot([one.sigma_px for one in own.values()], MIN_PX)
            wrong += [self.pair[row] for row in rows[find_contradicted(off, joint, sigma)]]
        return wrong


def choose_next_places(candidates: Candidates, wanted: Bools, record: Record) -> Ints:
    """Choose the places of the next round; none where all were tried.

    Parameters
    ----------
    candidates
        n predicted places.
    wanted
        (n,) mask of the requested ones.
    record
        The search so far.
    """
    places, pairs, picks = candidates.places, candidates.pair, candidates.pick
    radius, stretch = candidates.radius_px, compute_stretches(places.affine)
    best: dict[Pair, int] = {}
    for row in np.argsort(stretch, kind="stable").tolist():
        pair = pairs[row]
        open_ = wanted[row] and pair not in record.found and pair not in best
        if open_ and not candidates.is_alone[row]:
            tried = [m.radius_px for m in record.missed.get(pair, ()) if m.pick == picks[row]]
            if not tried or radius[row] < NARROWED_SHARE * min(tried):
                best[pair] = row
    rows = np.array(sorted(best.values()), dtype=np.int64)
    if not candidates.is_raised[rows].all():
        rows = rows[~candidates.is_raised[rows]]
    if not rows.size:
        return rows
    limit = max(MAX_RADIUS_PX, SIMILAR_RADIUS * float(np.quantile(radius[rows], MIN_ROUND_SHARE)))
    return rows[radius[rows] <= limit]


def choose_lines(candidates: Candidates, wanted: Bools, record: Record) -> Ints:
    """Choose places of labels of unknown height to search along their lines of sight.

    All places of a label are searched together, from one pick: that of the view most similar to
    the others which was not tried yet.

    Parameters
    ----------
    candidates
        n predicted places.
    wanted
        (n,) mask of the requested ones.
    record
        The search so far.
    """
    tried = {(pair, one.pick) for pair, all_ in record.missed.items() for one in all_}
    is_open = np.array(
        [
            pair not in record.found and (pair, pick) not in tried
            for pair, pick in zip(candidates.pair, candidates.pick.tolist(), strict=True)
        ],
        dtype=np.bool_,
    )
    rows = np.flatnonzero(candidates.is_alone & wanted & is_open)
    stretch = compute_stretches(candidates.places.affine[rows])
    mean: dict[tuple[str, int], list[float]] = {}
    for row, size in zip(rows.tolist(), stretch.tolist(), strict=True):
        mean.setdefault((candidates.pair[row][1], int(candidates.pick[row])), []).append(size)
    best: dict[str, int] = {}
    for (label, pick), _ in sorted(mean.items(), key=lambda one: float(np.mean(one[1]))):
        best.setdefault(label, pick)
    chosen = [best[candidates.pair[row][1]] == candidates.pick[row] for row in rows.tolist()]
    return rows[np.array(chosen, dtype=np.bool_)]


SHOWN = 29.0 / 30.0, 1.0 / 6.0
"""Share of the photos that show something like a label at its place on the ground: for points on
it, and for corners of cars and walls, where it is the ground behind them. Measured on rendered
streets."""

UNMOVED_PX = 1.0
"""Distance [px] by which the greatest height moves a point that is searched as on the ground."""

EVEN_ODDS = 1.0
"""Odds that a label without a height is on the ground, without further information."""

OUTLIER_LIKELIHOOD = 1e-12
"""Relative likelihood of what no height explains, such as a pick on another thing."""


@dataclass(frozen=True, eq=False)
class HeightEvidence:
    """n photos of labels of unknown height.

    Attributes
    ----------
    label
        (n,) the labels.
    off_px, covariance_px2
        (n, 2), (n, 2, 2): found or picked place less the one predicted from another pick on the
        ground; NaN where nothing was found there. And the covariance of that difference.
    rise
        (n, 2) d pixel / d height [px/m].
    is_picked
        (n,) whether a person picked it there.
    """

    label: tuple[str, ...]
    off_px: Floats
    covariance_px2: Floats
    rise: Floats
    is_picked: Bools


def find_raised_labels(evidence: HeightEvidence, odds: float = EVEN_ODDS) -> set[str]:
    """Find labels that are more likely off the ground than on it, by Bayes' rule.

    Each photo counts as far as a point off the ground would be elsewhere in it.

    Parameters
    ----------
    evidence
        What the photos show.
    odds
        Odds that a label is on the ground, before any other photo is searched.
    """
    height = np.concatenate([[0.0], RAISED_HEIGHTS_M])
    weight = np.asarray(np.linalg.inv(evidence.covariance_px2), dtype=np.float64)
    place = height[:, None] * evidence.rise[:, None]  # (n, heights, 2) from that on the ground
    is_within = _squares(place, weight) <= REGION_SQUARED
    beside = np.exp(-0.5 * _squares(evidence.off_px[:, None] - place, weight))
    # A search shows the point where its place is within the region, or else the ground behind it.
    on_ground, behind = SHOWN
    own = np.where(is_within, on_ground - behind, 0.0)
    found = own * beside + behind * beside[:, :1]
    likelihood = np.where(evidence.is_picked[:, None], beside, found)
    likelihood = np.where(np.isnan(likelihood), 1.0 - behind - own, likelihood)
    logarithm = np.log(likelihood + OUTLIER_LIKELIHOOD)
    raised = set[str]()
    # A height that would hardly move a point, as between photos from one place, shows nothing.
    moved_px = np.linalg.norm(place, axis=2).max(axis=1)
    logarithm[moved_px <= UNMOVED_PX] = 0.0
    for label in set(evidence.label):
        each = logarithm[[name == label for name in evidence.label]].sum(axis=0)
        off_ground = logsumexp(each[1:] - each[0]) - np.log(len(each) - 1)  # of the mean
        if off_ground > np.log(odds):
            raised.add(label)
    return raised


def shows_ground(evidence: HeightEvidence, odds: float = EVEN_ODDS) -> bool:
    """Return whether some of the labels taken for the ground are more likely on it than none.

    Their heights cannot show this, as the corners of one car may be a plane, too. But most photos
    show points on the ground at their places, and few show those off it. An unknown share of the
    labels is on the ground; all shares are equally likely before any photo is searched. (Bayes'
    rule)

    Parameters
    ----------
    evidence
        What the photos show; only searches count.
    odds
        Odds that a label is on the ground, before any photo is searched.
    """
    on_ground, behind = SHOWN
    is_found = np.isfinite(evidence.off_px).all(axis=1)
    each = np.log(np.where(is_found, on_ground / behind, (1.0 - on_ground) / (1.0 - behind)))
    searched = ~evidence.is_picked
    _, label = np.unique(np.array(evidence.label, np.str_)[searched], return_inverse=True)
    ratio = np.bincount(label, each[searched])
    # Likelihoods of what the photos show, by share, relative to that of labels off the ground.
    any_ = np.logaddexp(
        np.log(GROUND_SHARES)[:, None] + ratio, np.log1p(-GROUND_SHARES)[:, None]
    ).sum(axis=1)
    none = len(ratio) * np.log1p(-GROUND_SHARES)
    return bool(
        logsumexp(any_) - logsumexp(none) > np.log(2.0 / odds)
    )  # without none, more than none


GROUND_SHARES = (np.arange(100) + 0.5) / 100.0
"""Shares of the labels that are on the ground, for the mean over all of them."""


def _squares(off_px: Floats, weight: Floats) -> Floats:
    """Compute squared distances (n, h) of places (n, h, 2) in sigmas, by weights (n, 2, 2)."""
    return np.asarray(np.einsum("nhi,nij,nhj->nh", off_px, weight, off_px))


CONTRADICTED_SQUARED = float(chdtri(2, 1e-5))
"""Squared sigmas of the difference from the expectation by the others."""

NEARLY_WORST_SHARE = 0.7
"""Share of the worst one's squared sigmas above which another one may be the wrong one as well."""

TURNED = float(chdtri(3, 1e-4))
"""Squared sigmas of the camera's direction on its mount above which the log is not used."""

NONLINEAR_SHARE = 0.03
"""Share of a place's error that the linear model may miss: a pose error of a degree or two moves
places by other amounts at its edges."""


def find_contradicted(off_px: Floats, covariance_px2: Floats, sigma_px: Floats) -> Bools:
    """Mark finds (n,) that do not agree with the others.

    Parameters
    ----------
    off_px
        (n, 2) found less predicted.
    covariance_px2
        (2 n, 2 n) of the predictions.
    sigma_px
        (n,) of the finds.
    """
    n = len(off_px)
    noise = sigma_px**2 + (NONLINEAR_SHARE * np.linalg.norm(off_px, axis=1)) ** 2
    weight = np.linalg.inv(covariance_px2 + np.diag(np.repeat(noise, 2)))
    left = np.arange(n)
    while left.size:
        both = 2 * left[:, None] + np.arange(2)
        # Decrease of the squares without each find: p^T W_ii^-1 p, with p = (W e)_i.
        own = weight[both[:, :, None], both[:, None, :]]
        pull = (weight[:, both.ravel()] @ off_px[left].ravel())[both]
        fall = np.einsum("ni,ni->n", pull, np.linalg.solve(own, pull[..., None])[..., 0])
        if fall.max() <= CONTRADICTED_SQUARED:
            break
        out = both[fall >= NEARLY_WORST_SHARE * fall.max()].ravel()
        left = left[fall < NEARLY_WORST_SHARE * fall.max()]
        # Remove the worst finds from the joint distribution (Schur complement).
        weight = weight - weight[:, out] @ np.linalg.solve(weight[np.ix_(out, out)], weight[out])
    return ~np.isin(np.arange(n), left)


def measure_rotation_rad(boresight_rad: Floats, sigma_rad: float) -> float:
    """Return the angle of the camera from mount and log, 0 within their errors.

    The log's direction draws the adjusted one towards it: the angle is rather larger.

    Parameters
    ----------
    boresight_rad
        (3,) rotation vector, adjusted.
    sigma_rad
        Sigma of its prior, each axis.
    """
    angle = float(np.linalg.norm(boresight_rad))
    return angle if angle**2 > TURNED * sigma_rad**2 else 0.0

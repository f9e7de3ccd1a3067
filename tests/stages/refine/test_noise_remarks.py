"""What a survey says in words of ground that is no plane, and of picks."""

from __future__ import annotations

from dataclasses import replace

import pytest

from uavgram.model.result.reliability import (
    AreaNoise,
    EstimatedSigma,
    Noise,
    PickNoise,
    SurfaceShape,
)
from uavgram.stages.refine.noise_remarks import noise_remarks


def noise(
    rough_m: float, relief_m: float = 0.0, shape: SurfaceShape = "plane", factor: float = 1.0
) -> Noise:
    area = AreaNoise(
        area="default",
        stated_m=0.0,
        estimated_m=rough_m,
        sigma_m=0.01,
        shape=shape,
        relief_m=relief_m,
    )
    picks = PickNoise(source="hand", stated_px=0.8, factor=factor, sigma=0.05)
    return Noise(picks=(picks,), roughness=(area,))


@pytest.mark.parametrize(
    ("rough_m", "relief_m", "shape", "said"),
    [
        (0.05, 0.0, "plane", "about 5 cm off it, each point by itself"),
        (0.03, 0.04, "quadratic", "about 5 cm off it, as a crown or a hollow does"),
        (1.122, 1.05, "correlated", "about 1.5 m off it, in smooth rises and hollows"),
    ],
)
def test_ground_that_is_no_plane_is_told_and_where_to_see_it(
    rough_m: float, relief_m: float, shape: SurfaceShape, said: str
) -> None:
    (message,) = noise_remarks(noise(rough_m, relief_m, shape))

    assert (message.level, message.code) == ("warning", "ground-not-plane")
    assert message.text.startswith(f"This ground is not a plane: its points lie {said}; the ")
    assert "drawing in the report shows where" in message.text


def test_what_chance_makes_of_a_plane_is_not_told() -> None:
    (told,) = noise(0.05).roughness
    (picks,) = noise(0.05).picks
    for probability, messages in ((0.0005, 1), (0.01, 0)):
        area = replace(told, probability=probability)
        assert len(list(noise_remarks(Noise(picks=(picks,), roughness=(area,))))) == messages


def test_a_plane_and_picks_as_stated_are_no_news() -> None:
    assert not list(noise_remarks(noise(0.0)))
    assert not list(noise_remarks(None))
    (message,) = noise_remarks(noise(0.0, factor=1.6))
    assert "0.8 px stated, 1.3 ± 0.04 px found" in message.text


@pytest.mark.parametrize(
    ("source", "code", "said"),
    [
        ("hand", "picks-less-exact", "The picks made by hand are less exact than stated: 0.2 px "),
        ("target", "picks-less-exact", "The targets are less exact than stated: 0.2 px stated, "),
        ("match", "found-less-exact", "The matches are less exact than stated: 0.2 px stated, "),
        ("tie", "found-less-exact", "The tie points are less exact than stated: 0.2 px stated, "),
    ],
)
def test_each_source_of_picks_is_told_by_its_name(source: str, code: str, said: str) -> None:
    picks = tuple(
        PickNoise(source=one, stated_px=0.2, factor=1.6 if one == source else 1.0, sigma=0.05)
        for one in ("hand", "target", "match", "tie")
    )
    (message,) = noise_remarks(Noise(picks=picks, roughness=()))

    assert message.code == code
    assert message.text.startswith(said)
    assert message.level == ("info" if source in ("match", "tie") else "warning")


@pytest.mark.parametrize(("source", "count"), [("hand", 1), ("target", 1), ("match", 0)])
def test_likeness_that_is_more_exact_than_stated_is_no_news(source: str, count: int) -> None:
    picks = PickNoise(source=source, stated_px=0.2, factor=0.5, sigma=0.05)

    assert len(list(noise_remarks(Noise(picks=(picks,), roughness=())))) == count


@pytest.mark.parametrize(("factor", "is_reported"), [(3.4, True), (2.0, False), (0.5, False)])
def test_marks_far_beside_what_was_taped_are_reported(factor: float, *, is_reported: bool) -> None:
    beside = EstimatedSigma(stated_m=0.01, factor=factor, sigma=0.6)
    messages = list(noise_remarks(replace(noise(0.0), identification=beside)))

    assert [one.code for one in messages] == ["identification-less-exact"] * is_reported
    if is_reported:
        assert "within 1 cm of what was meant as stated, within 3.4 cm as found" in messages[0].text


@pytest.mark.parametrize(("factor", "said"), [(2.1, True), (1.35, False), (0.5, False)])
def test_lengths_that_scatter_more_than_stated_are_told(factor: float, *, said: bool) -> None:
    lengths = EstimatedSigma(stated_m=0.01, factor=factor, sigma=0.4)
    messages = list(noise_remarks(replace(noise(0.0), lengths=lengths)))

    assert [one.code for one in messages] == ["lengths-less-exact"] * said
    if said:
        assert "0.01 m stated, 0.021 m found" in messages[0].text

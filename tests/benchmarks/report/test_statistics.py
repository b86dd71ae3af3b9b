"""The statistics of a comparison: against hand-computed figures and known distributions."""

from itertools import permutations

import numpy as np
import pytest

from benchmarks.report.standings import Rank, improvement, ranking, ratio
from benchmarks.report.statistics import (
    interquartile_mean,
    interval,
    median,
    profile,
    replicated,
    resample,
    worst_tenth,
)


def apart(count):
    """Draws of so many independent cases of one stratum."""
    return resample([np.zeros(count, dtype=int)], np.arange(count), 500)


def test_interquartile_mean_by_hand():
    # 12 cases: three at each end are left out.
    values = np.array([100.0, -50.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 900.0, 8.0, -9.0])
    kept = [2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    assert interquartile_mean(values) == np.mean(kept)
    assert median(values) == 4.5
    # Of 7 one at each end: a quarter is rounded down.
    assert interquartile_mean(np.arange(7.0)) == np.mean([1, 2, 3, 4, 5])


def test_worst_tenth_by_hand():
    assert worst_tenth(np.arange(40.0)) == np.mean([36.0, 37.0, 38.0, 39.0])
    assert worst_tenth(np.arange(7.0)) == 6.0
    assert worst_tenth(np.arange(11.0)) == 9.5


def test_draws_keep_strata_and_stations_together():
    # 6 stations with two cases each in strata 0 and 1, 4 more with one case in stratum 2.
    strata = np.array([0, 1] * 6 + [2] * 4)
    units = np.array([0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 7, 8, 9])
    draws = resample([strata], units, 200)
    for row, counts in zip(draws.cases, draws.counts, strict=True):
        assert [int(np.sum(strata[row] == s)) for s in (0, 1, 2)] == [6, 6, 4]
        assert np.array_equal(counts, np.bincount(row, minlength=16))
        assert np.array_equal(counts[:12:2], counts[1:12:2])


def test_a_unit_without_like_is_exchanged_on_the_coarser_level():
    fine, coarse = np.arange(6), np.array([0, 0, 0, 1, 1, 1])
    draws = resample([fine, coarse], np.arange(6), 300)
    assert draws.known
    assert all(np.sum(coarse[row] == 0) == 3 for row in draws.cases)
    assert set(draws.cases.ravel()) == set(range(6))


def test_one_that_is_left_alone_is_exchanged_with_all():
    # Two stations in stratum 0, two in 1 and one in 2, which has no like.
    draws = resample([np.array([0, 0, 1, 1, 2])], np.arange(5), 300)
    assert draws.known
    assert set(draws.cases[:, 0]) == set(range(5))


def test_one_case_alone_has_no_interval():
    draws = resample([np.zeros(1, dtype=int)], np.zeros(1, dtype=int))
    estimate = interval(3.0, np.full(2000, 3.0), draws)
    assert estimate.estimate == 3.0
    assert np.isnan(estimate.low)
    assert np.isnan(estimate.high)


def test_same_seed_same_bits_and_another_seed_others():
    strata, units = np.repeat(np.arange(4), 5), np.arange(20)
    first, second = resample([strata], units), resample([strata], units)
    assert np.array_equal(first.cases, second.cases)
    assert not np.array_equal(first.cases, resample([strata], units, seed=1).cases)


@pytest.mark.parametrize(("stations", "each", "strata"), [(64, 1, 16), (30, 4, 1)], ids=str)
def test_intervals_hold_the_truth_as_often_as_they_say(stations, each, strata):
    # Errors of a station go together: its cases share most of their deviation.
    generator = np.random.default_rng(stations + each)
    at = np.tile(np.arange(each), stations) + each * np.repeat(
        np.repeat(np.arange(strata), stations // strata), each
    )
    units = np.repeat(np.arange(stations), each)
    held, trials = 0, 300
    for trial in range(trials):
        draws = resample([at], units, 250, seed=trial)
        shared = generator.normal(3.0, 1.0, (stations, 1))
        values = (shared + generator.normal(0.0, 0.3, (stations, each))).ravel()
        drawn = replicated(values[None], draws, interquartile_mean)[0]
        estimate = interval(float(interquartile_mean(values)), drawn, draws)
        held += estimate.low <= 3.0 <= estimate.high
    # Three standard deviations of 300 throws at 95 % are 3.8 %.
    assert 0.912 <= held / trials <= 0.988


def test_improvement_counts_wins_and_half_the_ties():
    first = np.array([1.0, 2.0, 3.0, 4.0])
    second = np.array([2.0, 2.0, 2.0, 5.0])
    draws = apart(4)
    assert improvement(first, second, draws).estimate == (1 + 0.5 + 0 + 1) / 4


def test_improvements_of_a_pair_add_up_to_one():
    generator = np.random.default_rng(3)
    first, second = np.round(generator.normal(size=(2, 50)), 1)
    draws = apart(50)
    there, back = improvement(first, second, draws), improvement(second, first, draws)
    assert there.estimate + back.estimate == 1.0
    assert there.low + back.high == pytest.approx(1.0)
    assert 0.0 <= there.low < there.estimate < there.high <= 1.0


def test_paired_ratio_resolves_what_single_intervals_do_not():
    generator = np.random.default_rng(4)
    station = np.exp(generator.normal(0.0, 0.5, 64))
    values = np.stack([0.95 * station, station]) * np.exp(generator.normal(0.0, 0.02, (2, 64)))
    draws = apart(64)
    drawn = replicated(values, draws, interquartile_mean)
    means = [float(interquartile_mean(v)) for v in values]
    single = [interval(m, d, draws) for m, d in zip(means, drawn, strict=True)]
    assert single[0].high > single[1].low
    estimate = ratio((means[0], means[1]), (drawn[0], drawn[1]), draws)
    assert estimate.estimate == pytest.approx(means[0] / means[1])
    assert 0.93 < estimate.low < 0.95 < estimate.high < 0.97


def simulated(generator, shift, controllers=6, cases=60):
    """Errors of controllers of which the first is better by a factor."""
    station = generator.normal(0.0, 0.5, (1, cases))
    own = generator.normal(0.0, 0.2, (controllers, cases))
    values = np.exp(station + own)
    values[0] *= shift
    return values


def ranked(values, draws):
    means = [float(interquartile_mean(v)) for v in values]
    return ranking(means, replicated(values, draws, interquartile_mean), draws)


@pytest.mark.parametrize(("cases", "controllers"), [(60, 6), (6, 4), (6, 2)])
def test_equal_controllers_are_seldom_ranked_apart(cases, controllers):
    generator, draws = np.random.default_rng(5), apart(cases)
    values = (simulated(generator, 1.0, controllers, cases) for _ in range(120))
    wrong = sum(ranked(each, draws).separated.any() for each in values)
    # At 5 % for all pairs together, more than 13 in 120 has a chance of 1 in 100.
    assert wrong <= 13


def test_intervals_of_pairs_and_ranks_never_contradict_each_other():
    generator, draws, differ = np.random.default_rng(7), apart(6), 0
    for shift in np.linspace(0.3, 1.0, 40):
        each = ranked(simulated(generator, shift, 4, 6), draws)
        for a, b in permutations(range(4), 2):
            there, back = each.ratios[a][b], each.ratios[b][a]
            assert each.separated[a, b] == (there.high < 1.0) == (back.low > 1.0)
            assert there.low <= there.estimate <= there.high
            assert not each.separated[a, b] or each.ranks[a].best < each.ranks[b].worst
            differ += there.high < 1.0
        for at, rank in enumerate(each.ranks):
            assert rank.best == 1 + each.separated[:, at].sum()
    assert 20 < differ < 120


def test_a_better_controller_is_ranked_first_and_the_rest_share_the_others():
    values = simulated(np.random.default_rng(6), 0.5)
    ranks = ranked(values, apart(60))
    assert ranks.ranks[0] == Rank(1, 1)
    assert all(rank == Rank(2, 6) for rank in ranks.ranks[1:])
    assert str(ranks.ranks[1]) == "2–6"
    assert ranks.separated[0, 1:].all()
    assert not ranks.separated[1:].any()


def test_ranks_of_one_controller_and_of_single_cases_claim_nothing():
    assert ranked(np.ones((1, 10)), apart(10)).ranks == (Rank(1, 1),)
    alone = resample([np.zeros(1, dtype=int)], np.zeros(1, dtype=int))
    ranks = ranked(np.array([[1.0], [2.0]]), alone)
    assert ranks.ranks == (Rank(1, 2), Rank(1, 2))


def test_profile_is_the_distribution_of_the_errors():
    errors = np.array([1.0, 2.0, 2.0, 4.0])
    share, low, high = profile(errors, np.array([0.5, 1.0, 2.0, 3.0, 4.0]), apart(4))
    assert share.tolist() == [0.0, 0.25, 0.75, 0.75, 1.0]
    assert np.all((low <= share) & (share <= high))
    assert (low[0], high[0]) == (0.0, 0.0)
    assert (low[-1], high[-1]) == (1.0, 1.0)


def test_profile_band_is_that_of_a_binomial_share():
    errors = np.arange(400.0)
    _, low, high = profile(errors, np.array([199.5]), apart(400))
    # Half of 400: a standard error of 2.5 %.
    assert (high - low)[0] == pytest.approx(2 * 1.96 * 0.025, rel=0.15)

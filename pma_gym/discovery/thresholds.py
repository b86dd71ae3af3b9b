"""The numbers by which the method for stations and imposed motions decides, and checks of files.

Those of the likelihood are in `grey_box/thresholds.py`; both share the first few. Each says where
it comes from: a derivation, or "assumption". Numbers of the numerics stand where they are used.
"""

# Both methods.

CONFIDENCE = 1.96
"""Standard deviations of a 95 % interval; a size within them may be absent."""

SURE = 3.0
"""Standard errors from which on a size, change or distance is there: 1 in 400 by chance."""

LEFT = 0.5
"""Share of the misfit beyond noise (mean square) that effects may leave to be given with sizes.

They carry at least half.
"""

MOST_EFFECTS = 3
"""Effects at most: a beam of more was never right on data whose effects are known (design)."""

COMPLETE = 1.5
"""Noises or floors by which a complete model misses readings left out at most (rms): assumption."""

# Of several tests.

CERTAIN = 6.0
"""Standard errors that chance does not reach, over all lags of an autocorrelation or all trials."""

SIGNIFICANT = 0.05
"""Chance, over all signals and regions of a test, that it says what is not so: the usual 5 %."""

STRUCTURE = 3.0
"""Noises (standard deviations) from which on what is seen is no noise: 1 in 400 by chance."""

BLOCK_S = 1.0
"""Length of stretches of time that are independent (s): longer than noise and rig remember."""

LEAST_CHANGE = 0.15
"""Effect or drift (root mean square) in standard deviations of the noise, below which it is none.

What is smaller is not worth a name, and no model's arithmetic is that exact: assumption.
"""

SLIGHT = 0.1
"""Change by refitted parameters, bandwidth or line, in noises (rms), that is none: assumption."""

LEAST_GAIN = 30.0
"""Chi-square that an effect, a size of its own or a refit gains at least: chance gives some three.

Assumption.
"""

FLAT = 4.0
"""Chi-square within which a profile is flat, and a wider range not worth it.

Twice a log-likelihood of 2.
"""

AS_GOOD = 4.0
"""Ratio of chi-squares from which on one law is nearer whatever chance says: half the residual.

Where one trial outweighs all others, chance alone would allow anything.
"""

WORTH_A_FIT = 0.05
"""Share of the largest promise below which a candidate or a value is not fitted: assumption."""

# Checks of files.

LOG_ROWS = 50
"""Readings of a trial below which it is a table or a summary, and no log: assumption."""

SLOWEST_S = 0.5
"""Usual step (s) from which on a log cannot show this rig: it moves and settles in less."""

FASTEST_S = 2e-5
"""Usual step (s) below which no logger of such a rig samples."""

SMOOTH = 0.25
"""Largest share of its span by which a log of one course changes from row to row: assumption."""

USUAL_STEP_S = (5e-4, 0.1)
"""Steps (s) of a log of such a rig, between which another unit of time is proposed: assumption."""

SAME_RATE = (0.75, 1.34)
"""Ratios of two rates between which they count as one: assumption."""

CLEAR_RATE = 0.7
"""Largest share of the next best misfit at which the best rate is proposed: assumption."""

WORTH_A_LEAD_IN = 0.05
"""Share of a record's stroke that a lead-in must cover to be worth its rows: assumption."""

LEAST_ABSOLUTE_PA = 80e3
"""Least commanded pressure (Pa): the air's, on a mountain; less is no absolute pressure."""

CLOSER, CLOSER_OUTSIDE = 0.4, 0.6
"""Largest share of the misfit that is left once the pressures are corrected: of commands that lie
inside the model's range as they are, and outside. Assumptions."""

BEYOND = 1.2
"""Factor by which the highest command may lie beyond the model's range: assumption."""

UNDOUBTED_M = 1e-3
"""Misfit (rms) of contraction (m) below which the commands are not doubted: assumption."""

MOVING_SLOPE = 0.3
"""Share of the mean first speed that a parabola has at the beginning: a rig at rest has none."""

BETTER_BEGINNING = 0.5
"""Largest share of the misfit of a beginning at rest that one in motion leaves: assumption."""

FORGOTTEN = 0.5
"""Standard deviations of a sensor below which the lead-in no longer shows: assumption."""

LONGER = 1.5
"""Times as long as the model needs for the lead-in to be forgotten: a rig may be slower than it."""

LEAST_FORGETTING_S = 0.1
"""Least time after which readings count (s): assumption."""

LEAST_COUNTED = 0.5
"""Smallest share of a trial whose readings must still count: assumption."""

LEAST_LAG_S, LEAST_LAG_ROWS = 3e-3, 0.3
"""Shortest lag that is named: in s, and in rows. Assumptions."""

LAG_LEFT = 0.3
"""Largest share of the misfit's square that is left once a signal is shifted: assumption."""

SAME_LAG = 0.2
"""Largest share by which lags of several signals may differ: assumption."""

SINGLE_LAG_S = 10e-3
"""Shortest lag of a single signal that is named (s): what parameters can do is less."""

CORRELATED = 0.9
"""Least correlation of measured and simulated that shows a slope or a lag: assumption."""

AS_GIVEN = (0.35, 2.8)
"""Slopes that a wrong model may give: no unit is looked for there. Assumption."""

NEAR_UNIT = {"contraction": 0.4, "rotation": 0.4, "load": 0.25}
"""Largest distance of a slope's logarithm from a unit's, by what the model may be wrong about."""

NEAR_LEVEL = 0.25
"""Largest share that a level may be off the unit's: assumption."""

PRESSURE_NEAR, PRESSURE_FAR = 0.06, 0.15
"""Largest share that a pressure may be off what a unit gives; least that it is off otherwise. A
regulator holds its pressure, but for the local weather (+-5 kPa) and its own faults."""

WEATHER_PA = 16e3
"""How much less than the standard pressure the air of a high town has (Pa)."""

FAR_ZERO_M = 0.02
"""Distance from the simulated contraction (m) from which on a zero is proposed too: assumption."""

LEAST_RATE_HZ = 60.0
"""Least rate that averaging leaves (Hz): slower would hide the rotor's oscillation on the cable."""

LINE_PASSES = 0.2
"""Largest share of a line of mains that averages leave where it is not looked for: assumption."""

NEAR_NYQUIST_HZ = 1.0
"""How near to half the rate that is left a line may lie (Hz): assumption."""

WORTH_AVERAGING = 0.5
"""Most rows that trials of one rate may keep, as a share of their own: a command that changes in
every row needs them all, and averages of readings would only hide the fastest."""

JUMP, RARE = 4.0, 0.05
"""Noises off its parabola from which on a block jumps, and the share of blocks that may: where more
are, readings are as fast as that all the time. Assumptions."""

# Noise, floors and nuisances.

RECORDED = 0.4
"""Bandwidth of a motion over the rows in a second that record it, at most: half would be none."""

REST_S = 0.6
"""How long commands are constant before a segment counts as rest (s): some six time constants of
the regulator."""

FIRST_REST_S = 0.1
"""How long they are at the beginning of a trial, which begins settled (s): assumption."""

LEAST_REST = 12
"""Fewest readings of a segment at rest: assumption."""

LEAST_SEGMENTS = 3
"""Least number of segments that show which of them are at rest: assumption."""

MOVING_SPREAD, QUIETEST = 4.0, 3.0
"""Spread of a segment in which something moves, over that of quiet ones; and of the quiet ones over
the quietest, at most. Both are assumptions."""

ENOUGH_FOR_NOISE = 120
"""Fewest readings at rest, over all trials, that tell a noise level: to 6 %."""

ENOUGH_FOR_FLOOR = 40
"""Fewest readings at rest, over all trials, whose standard deviation is a floor: it is known to
11 % then, where the verdict leaves 50 %."""

ENOUGH_FOR_COLOUR = 400
"""Fewest readings in repeats, or at rest, from which the colour of noise is learnt: a correlation
is known to 0.05 then."""

STILL = 0.05
"""Share of the readings at rest that turn back, below which they stand still or settle: of noise a
third of a step high, on average a sixth turn back."""

TURN_BACK = 0.3
"""Move from reading to reading, in standard deviations, from which on it is one: assumption."""

SLOW_S = (0.06, 0.15)
"""Lags (s) over which a residual still resembles itself only where the model is wrong: sensors'
noise is uncorrelated after 0.06 s (assumption)."""

COARSER = 1.5
"""How many of the steps that a sensor should have make a step coarse: assumption."""

MISS = 0.05
"""Share of a step that a reading may miss a whole one by; over all steps between the least and the
largest reading, of which there are at least as many as differ, that is what the step may be off."""

HIDDEN = 1.0
"""Noise hides a step if its standard deviation, rounding included, is this many steps or more: what
rounding adds to such readings is noise like any other."""

DITHER = 0.3
"""Noise before rounding, in steps, that makes an error of rounding noise as well: nobody need know
which step the sensor should have."""

STEP_CHANCE = 0.1
"""Of a reading that lies within a twentieth of a step from a whole one by chance. Two readings make
the step; every other that differs from them has to keep to it."""

DRIFT_CHANCE = 1e-3
"""That noise without a drift is taken for one with a drift, over all signals: assumption."""

DRIFT_ENLARGED = 2.0
"""By what a drift that repeats tell is enlarged: a pair of them tells its size to a factor of two,
and too small a size leaves a drift that looks like the rig's."""

MOST_MISSING = 0.1
"""Share of readings that may be missing in repeats, such as outliers set aside: assumption."""

MOST_WAVES, WAVE_CHANCE = 6, 1e-4
"""Most half waves of a drift in a trial, and the chance that noise has one that commands do not
leave free. Assumptions."""

LEAST_HALVES, MOST_HALVES = 3, 4
"""Least and greatest number of half periods of a drift in a trial; the least hold one period and a
half of any phase."""

SLOW_SHARE = 0.1
"""Share of a command's variance below its slowest excited frequency: assumption."""

WANDER, MOST_TURNS = 4e-4, 24
"""How far a line's frequency is off in a trial, as a share of it, and how many half turns of that a
trial gives it at most. An assumption: the frequency of mains changes by 20 mHz."""

LEAST_ALIAS_HZ = 4.0
"""Alias below which a line is not looked for (Hz): commands excite the rig there."""

LINE_CHANCE = 1e-5
"""That noise is taken for a line, for one signal and one frequency: assumption."""

LEAST_HARMONIC = 0.02
"""Line (rms) beside another of the same mains, in noises, that is none: it repeats for as long as
the trial and adds up in autocorrelation."""

INDEPENDENT_S = 0.25
"""How long a piece of a residual is whose sign is flipped as a whole (s): longer than whitening
leaves of the noise's memory; what shows for a second makes more than a handful."""

FOLDS = 6
"""Parts that trials are divided into; each is left out once: assumption."""

LONG_S = 20.0
"""A single trial of this length (s) or more has stretches that can be left out: assumption."""

STRETCH_S = 5.0
"""About how long such a stretch is (s): longer than the memory of the rig."""

# Parameters.

PRIOR_SHARE = 0.10
"""Standard deviation of what a lab's parameters are off by, as a share of them: an assumption.
Where data determine a parameter it hardly counts; it holds those that they do not."""

PRIOR_LEAST = {
    "N": 5.0,
    "kPa": 5.0,
    "mm": 0.5,
    "deg": 1.0,
    "N/mm": 0.5,
    "N s/mm": 0.05,
    "N/bar": 5.0,
    "N/bar/%": 0.5,
    "N/bar^2": 1.0,
    "N/bar^2/%": 0.1,
    "N/%": 1.0,
    "N/mm/kPa": 0.002,
    "N s/mm/kPa": 2e-4,
    "V": 0.05,
}
"""Least standard deviation of a parameter by its unit, for those that may be near 0: assumptions,
about a hundredth of what the station's quantities reach."""

PRIOR_WIDER = 2.0
"""How many times as wide as a model file's own 95 % interval a parameter may lie, for another
rig: assumption."""

PRIOR_SIZE = 10.0
"""How many times its size a parameter might have been, for all that is known beforehand. Outermost
bounds say less: those of a bandwidth reach to 100 kHz."""

FARTHEST = 6.0
"""Standard deviations of its prior that a parameter may go away from its value: assumption."""

MOST_DOUBLINGS = 5
"""How often such a range is doubled at most: assumption."""

LEAST_STRETCHES = 10
"""Fewer stretches than this are too few to tell how parameters scatter between them: assumption."""

LEAST_TRIALS = 4
"""Fewer trials than this say nothing of how parameters scatter between them: assumption."""

LEAST_DEFLECTION = 1e-5
"""Share of the way that a bandwidth may take from it: a contact that turns round deflects by more
(an assumption)."""

FALLS = 3.0
"""How many times less a doubled bandwidth must change the force than the one before, at least:
assumption."""

WORSE = 1.01
"""Chi-square over that at the stated bandwidth from which on a faster motion is refused: the record
has hum, say, which nothing moves by."""

DETERMINED = 0.7
"""A parameter whose standard error is a larger share of what was assumed of it beforehand is not
determined by the data: at 0.7 they tell as much as the assumption."""

FAR_ABOVE, FAR_BELOW = 30.0, 1e-4
"""How many times as large as the largest in the trials a value is that does what an infinite one
does; and the share of it that does what none does. Assumptions."""

OFF_ODDS = 20.0
"""Odds beyond which a parameter is said to be off: that it is not is then as unlikely as that a
95 % interval misses."""

SAME_PARAMETERS = 0.9
"""Correlation from which on two parameters do the same to the signals: assumption."""

# Screening.

LARGEST_NOISE = 10.0
"""Residual (rms), in standard deviations of a signal's noise, from which on it is no noise
whatever its form: assumption."""

LONGEST_LAG_S = 0.6
"""Longest lag of an autocorrelation that is looked at (s): assumption."""

LEAST_AUTOCORRELATION = 0.025
"""Autocorrelation below which the autocorrelated part is smaller than 0.16 of the noise."""

TONE_HZ, TONE_WIDTH, TONE_SHARE = 0.4, 0.25, 0.7
"""A tone's least frequency (Hz), for slower than that every trial is one swing; half its width as a
share of it; the least share of the autocorrelation that makes a tone."""

TONE_PERIODS = 2.0
"""Least number of a tone's periods in the longest part: what a piece leaves may swing once."""

SCAN_CHANCE = 2.5e-5
"""Chance, at most, that noise alone makes a burst anywhere in a signal's residual: with four
signals, one data set in ten thousand."""

OUTLIER = 3.5
"""Standard deviations beyond which a reading is an outlier: 1 in 2000 by chance."""

OUTLIERS_CHANCE = 0.01
"""Chance, over all pieces of a signal, that as many outliers fall into one of them as there are,
where they come one by one: a sensor may throw readings, at any rate, without structure."""

SHOWN_GAIN = 25.0
"""Chi-square that an effect must gain to be seen for certain: five standard deviations."""

MOVING = 0.05
"""Slowest speed that counts as motion, as a share of the largest in all trials: assumption."""

SLOWEST_M_S = 0.5e-3
"""Slowest speed that counts as motion (m/s), where that is less: assumption."""

COMMAND_STEP, COMMAND_STEP_PER_S = 0.01, 0.8
"""Least change of a command between two rows, and its rate (1/s), that is a step, as shares of the
command's range. Assumptions."""

SMALLEST_REGION, LARGEST_REGION = 0.02, 0.9
"""Shares of a signal's readings between which a region is one: assumptions."""

MOST_OF_A_SIGNAL, MOST_REGIONS = 3, 8
"""Regions that are reported at most, of a signal and in all: assumptions."""

LEAST_SHARE, LEAST_LIFT = 0.15, 1.25
"""Least share of the gap in a region that is reported, and how many times its share of readings.
Assumptions."""

SECOND_WORTH = 1.15
"""How many times the score of either must be that of two conditions together: assumption."""

OVERLAP = 0.5
"""Share of a region's gap that may lie in another that is reported already: assumption."""

VISIBLE = 1.05
"""Mean square of a residual, in units of the noise's, from which there is a gap: assumption."""

FORCE_SHARE, SPEED_SHARE = 0.1, 0.05
"""Usual size of a force over that of the drive, and of a speed at which something changes over the
speed of the trials. Assumptions."""

SLIP_DEFLECTION = 1e-3
"""Most of what a contact deflects before it slips, over the way of the trials: an assumption."""

RIPPLE_PERIODS = 1.25
"""Least number of a ripple's periods over the longest way: a bump at an end of the way is part of a
wave, too, that is never seen to repeat."""

STATIC_SHARE = 2.0
"""Largest static friction that is looked for, over the strongest force in the trials.

Friction that no force of the trials overcomes holds the rig, however large it is: the trials tell
no value above the strongest force from another. A fit that goes there meets a contact so stiff that
it rings a thousand times a second, and does not end. Twice, because mass and drive are known to a
share only."""

# Selection.

ALARM = 0.005
"""Family-wise rate of false alarms that the gate lets through: one data set in 200."""

BESIDE_DRIFT = 0.05
"""Least change beside a drift, which is as slow as creep and takes up most of it. An assumption:
creep as large as the noise changes 0.07 to 0.13 beside a drift."""

BESIDE_STEPS = 0.5
"""Least change beside a sensor whose readings keep to coarse steps: what is lost between them is no
noise, and follows the motion. Assumption."""

CARRIED = 0.5
"""Share of the bursts in a residual that a fit must explain, where they alone opened the gate:
noise that is larger in places bursts too, and no effect explains half of that."""

TRIED = 8
"""Candidates that are fitted after each screening, the most promising ones: assumption."""

LIKELY = 0.25
"""Share of the best promise from which on a candidate has more beginnings: assumption."""

LEAST_KEPT = 0.7
"""Share of the gain that a score promised below which a fit is tried again from a scan of the
candidate's range: assumption."""

LEAST_FITTED = 0.35
"""The share of that gain below which a candidate counts as one that could not be fitted:
assumption."""

SAME_MINIMUM = 0.05
"""Share of chi-square within which two fits ended at the same minimum: a further beginning that
ends there too tells nothing new."""

NOISE_LEFT, MOST_OF_IT = 1.05, 0.8
"""Noises left from which on another effect counts that carries this share of what is left beyond
the noise: an approximate law leaves less, and no other law carries that."""

MAJORITY = 0.5
"""Share of the trials left out that an effect, or a law, must predict better: most of them."""

COST = 3.0
"""Log-likelihood that a parameter costs: half the logarithm of some 400 effective readings."""

SECOND_SHARE, SURE_SHARE = 0.12, 0.02
"""Least share of the first effect's gain that another must bring: what a law of the catalogue
misses of its real likeness is of that order; and the same where the residual is surely no noise."""

NEAREST = 12.0
"""Chi-square within which two effects are not identifiable: odds of 400 to 1."""

NEAREST_SHARE = 0.02
"""The same as a share of what the effect gained: laws of a catalogue are likenesses, and the wrong
one of two that differ by less may be the nearer likeness by chance."""

REFITTED_RIVAL = 0.35
"""Share of the gain within which a rival is fitted again, with reestimated noise: assumption."""

MOST_REFITTED = 5
"""Most rivals that are fitted again: assumption."""

# Verdict.

MOST_EXPLAINED = 0.5
"""What a flexible regression may explain of the misfit (rms), in floors: upper 95 % bound."""

LEAST_BLOCKS = 8
"""Fewest blocks whose bound means anything: assumption."""

WORSE_BLOCKS = 4
"""Fewest blocks whose bootstrap means anything: assumption."""

WORSE_FLOORS = 0.05
"""Growth of a misfit (root mean square) that is worth a word, in noise floors: assumption."""

MOST_TOLERANCES = 1.0
"""Largest misfit, in tolerances, that a model without effects may leave: what the word means."""

ALIKE_CHANCE = 0.02
"""Chance, over all signals, that sensors drift as much alike, for an open verdict: assumption."""

ALIKE_BESIDE = 1e-6
"""The same beside effects that explain most, for a name to be withheld: a right law that is not the
rig's to the last digit leaves something slow, too. An assumption."""

ALIKE_TRIALS = 3
"""Fewer trials than this may drift alike by chance."""

LEAST_SLOW = 0.02
"""Mean square of a signal's slow residual over its noise's, below which it is none: assumption."""

SLOW_LEFT = 0.35
"""Share of what was slow in the residual that effects may leave that explain it: assumption."""

DOUBTFUL = 0.08
"""The share from which on laws without a shape of their own are set against effects: assumption."""

SHAPE_FACTOR, SHAPE_GAIN = 1.15, 60.0
"""By what a law without a shape must explain more than the effects to say that they are not it: a
factor on their gain in chi-square, and chi-square. Assumptions."""

WORTH_DRAWING = 0.15
"""Share of the chi-square beyond noise that such a law must explain to be drawn: assumption."""

MOST_AUTOCORRELATED = 0.1
"""Largest fraction of the autocorrelated residual that is left, beyond chance: assumption."""

MOST_SPREAD = 0.12
"""Most that an effect's size may scatter by trial or condition, beyond chance, as a share of it:
assumption."""

EXTRAPOLATED = 1.0
"""Scatter from which on it is extrapolated: sizes of groups come from slopes, which hold for small
changes. Sizes that really scattered by more than themselves would leave a residual."""

LEAST_GROUPS = 3
"""Fewest groups in which an effect is seen that tell whether its size differs: assumption."""

CONDITION_GROUPS = 4
"""Groups of equal size by each condition: quarters of the data."""

MOST_OF_SHAPES = 1.25
"""Noises that several laws of the position alone may leave: assumption."""

MOST_OF_RIVALS = 0.05
"""Share of the misfit beyond noise (sum of squares) that one law of the position alone may leave
where a rival draws the rest as well: a right law leaves less, whatever smaller effect is beside."""

PERIODIC_TURNS, BUMP_HEIGHTS = 4, 3
"""Changes of sign from which on a drawn law is periodic: two periods; and heights above half the
largest up to which it is a bump. Assumptions."""

UNDETERMINED = 3.0
"""Times the median standard error from which on a height is none that the data know."""

APPROXIMATE_LEFT = 0.15
"""Most of the misfit beyond noise (mean square) that an approximate law may leave: assumption."""

APPROXIMATE_SCATTER = 0.25
"""Most that the size of an effect may scatter by trial or condition for its law to be named as an
approximate one: what scatters more (a friction that grows with pressure) has another law."""

LEAST_MISFIT = 0.3
"""Mean square beyond noise, over that of the noise and summed over signals, below which a share of
it is none that the trials tell."""

MOST_RIVALS = 2
"""Most other phenomena that an effect may be confused with and still be named: groups of three."""

MUCH_EXPLAINED = 0.1
"""Share of chi-square that an effect could explain, from which on its not passing the gate means
that there are too few data, not that the structure is right. Assumption."""

UNDETECTABLE_SHARE = 0.35
"""Share of the catalogue that would not have shown, from which on the verdict is `undecidable`: in
six well excited trials it is up to a fifth, with low excitation 0.38 or more."""

# The next experiment.

UNDETECTABLE_WORTH = 0.2
"""Share of the catalogue that would not have shown, from which on an experiment that would show it
is proposed although nothing seems to be missing: in well excited trials it is up to a fifth."""

SMALLEST_SIZE = 0.1
"""Least size of an effect that is reckoned with, as a share of its usual one: assumption."""

SETTLED = SHOWN_GAIN / 2.0
"""Log odds that settle a question: five standard deviations. A shorter test that would leave it
open is not preferred to one that settles it."""

RESOLVED = 1.0
"""Log odds below which no excitation tells two rivals apart at all: less than 3 to 1."""

MOST_LOG_ODDS = 50.0
"""Largest log odds that are promised: no model is that exact."""

LIMIT_SHARE = 0.9
"""Share of each limit that an excitation may use: a tenth to spare."""

LEAST_LOAD_N = 25.0
"""Least load (N): the cable stays taut."""

MOST_VOLTS = 9.5
"""Most volts of a command, of the 10 that there are."""

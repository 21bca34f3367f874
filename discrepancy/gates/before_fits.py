"""Gates of recordings, channels and the screen: before any effect is fitted."""

from typing import Final

from discrepancy.gates.gate import listed as _gate

# 1 recordings and channels, before any physics is blamed

SAMPLES_IN_A_BLOCK: Final = _gate(
    name="samples in a block",
    of="channel",
    statistic="samples of a channel in a row, in a window",
    threshold=8,
    source="fewer say nothing beyond the initial state of the window",
    otherwise="the block is left out; a recording without a block is inconclusive",
    module="model.windows",
)
SAMPLES_TO_CHECK: Final = _gate(
    name="samples to check a channel",
    of="channel",
    statistic="samples of a channel in a recording",
    threshold=30,
    source="a correlation from fewer is uncertain by more than 0.2",
    otherwise="scale, sign and clock of the channel are not checked",
    module="checks.channel_checks",
)
SAME_QUANTITY: Final = _gate(
    name="same quantity",
    of="channel",
    statistic="correlation of prediction and reading",
    threshold=0.8,
    source="below it, an effect that is missing can make the difference by itself",
    otherwise="scale, sign and clock of the channel are not judged; an offset between loggers is not estimated",
    module="checks.channel_checks, checks.clocks",
)
UNIT_FACTOR: Final = _gate(
    name="factor between units",
    of="channel",
    statistic="distance of the slope, reading over prediction, from a factor between units or from -1, as a share of it",
    threshold=0.2,
    source="what the model leaves out moves the slope by some per cent; factors between units are further apart",
    otherwise="closer, where no effect of the library leaves less of the channel: it is left out and the likely heading is named",
    module="checks.channel_checks",
)
WITHIN_PRIORS: Final = _gate(
    name="within the priors",
    of="channel",
    statistic="misfit with the nuisances fitted, none beyond its prior, over the misfit without",
    threshold=0.5,
    source="on an even drive a zero error within its prior looks like a wrong sign: it takes most of the misfit, a wrong sign leaves it",
    otherwise="lower: the sign of the channel is taken as right",
    module="checks.channel_checks",
)
OTHER_CLOCK: Final = _gate(
    name="another clock",
    of="channel",
    statistic="misfit at the best shift over the misfit at the shifts that a sensor's delay may explain",
    threshold=0.5,
    source="a shift always helps a little; a wrong clock explains most of the misfit",
    otherwise="lower, with a correlation of 0.8 or more, where no effect of the library leaves less of the channel: it is left out and the shift is named",
    module="checks.channel_checks",
)
FILES_OVERLAP: Final = _gate(
    name="files overlap",
    of="recording",
    statistic="time that two files of one run have in common, as a share of the shorter",
    threshold=0.5,
    source="files of one run are recorded together",
    otherwise="their starts are taken as one before the offset is estimated",
    module="checks.clocks",
)

CONTENT_KEPT: Final = _gate(
    name="content kept",
    of="channel",
    statistic="share of the energy of each parameter's sensitivity, beyond initial states, that means over neighbouring samples keep",
    threshold=0.99,
    source="a model that is right to a tenth cannot be judged by content that is a hundredth of its energy (ADR 27)",
    otherwise="samples are not averaged any further; above, twice as many make one row",
    module="selection.bandwidth",
)

OUTLIER: Final = _gate(
    name="no outlier",
    of="row",
    statistic="one-step error, every candidate projected out, in standard deviations by the median",
    threshold=6.0,
    passes="below",
    source="two in 10^9 under Gaussian noise",
    otherwise="the row is set aside, and the result lists it",
    module="estimation.set_aside",
)
ODD_INTERVAL: Final = _gate(
    name="no interval that nothing explains",
    of="row",
    statistic="root mean square of ten such errors that follow one another, none counted for more than 6",
    threshold=4.0,
    passes="below",
    source="five rows at least have to be large; strong effects of the library, which are taken out to first order only, left up to 3.3",
    otherwise="the ten rows are set aside, and the result lists them with their time",
    module="estimation.set_aside",
)
SET_ASIDE: Final = _gate(
    name="little enough to set aside",
    of="channel",
    statistic="share of the rows that would be set aside",
    threshold=0.1,
    passes="below",
    source="beyond a tenth it is not an exception, but how the machine or the sensor is",
    otherwise="nothing is set aside",
    module="estimation.set_aside",
)


# 2 screen

FALSE_ALARM: Final = _gate(
    name="chance of a false alarm",
    of="effect",
    statistic="p-value of the score, or of the reduction in SSE, over the number of candidates (Bonferroni; at least 2 ln(K / 0.02))",
    threshold=0.02,
    passes="below",
    source="false findings on recordings with nothing missing: target 3 %, with a margin (ADR 6)",
    otherwise="the effect is not accepted; ruled out, or could not be judged, by its power",
    module="selection.assess, selection.candidate_fits",
)
WORTH_A_FIT: Final = _gate(
    name="worth a fit",
    of="effect",
    statistic="score before the division by the variance inflation",
    threshold=3.0,
    source="below one and a half standard deviations; a doubtful inflation must not keep an effect from being fitted",
    otherwise="the effect is not fitted",
    module="selection.candidate_fits",
)
OUTSIDE_BOUNDS: Final = _gate(
    name="expected change within bounds",
    of="effect",
    statistic="distance of the expected value beyond a physical bound, in typical changes",
    threshold=0.5,
    passes="below",
    source="the expected change is of first order",
    otherwise="the score at this trial step counts as zero",
    module="selection.screen",
)
DISCRETE_SHARE: Final = _gate(
    name="nearer to there than to not there",
    of="effect",
    statistic="distance of the expected change of a discrete parameter from its one change, as a share of it",
    threshold=0.5,
    passes="below",
    source="half way",
    otherwise="the score at this trial step counts as zero",
    module="selection.screen",
)
BLOCKS_TO_COMPARE: Final = _gate(
    name="blocks of time to compare",
    of="effect",
    statistic="blocks of time in the recordings",
    threshold=8,
    source="the variance of fewer than eight numbers is known to worse than a factor of two",
    otherwise="intervals are not widened by the disagreement of blocks; temporary effects are not searched",
    module="selection.screen",
)
HALF_STEP: Final = _gate(
    name="a step that is fine enough",
    of="recording",
    statistic="squared whitened change of the predictions by half of the model's step, nuisances and initial states apart; cheap models",
    threshold=20,
    passes="below",
    source="an effect of a library of a hundred needs 17 to be accepted; exact integrations come to 6 at most (bodies of the proof), a pressure chamber in steps of 10 ms with a false lag to 24",
    otherwise="a sentence says so, and an effect whose size small steps would change by half of itself is the best proxy",
    module="decision.sizes.half_step, decision.caveats",
)

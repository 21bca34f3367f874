"""The table of gates: every test that a channel, an effect, a group, an equation or a verdict has to pass, in the order of application.

For readers who want to know why an effect was named or not. The engine reads its thresholds from here and
docs/explanation/discrepancy.md prints the table, so that neither can differ from the other. The file lies beside the folders of the
engine and imports nothing but the class of a gate: screening, checks and decisions all read it.

Limits of pure numerics (iterations, rounding, caches) stay where they are used. Limits of cost are in
discrepancy.estimation.effort and discrepancy.selection.state; those that keep an effect from being tried appear in the reasons.
"""

from typing import Final

from discrepancy.gate import TABLE, markdown
from discrepancy.gate import Gate as Gate
from discrepancy.gate import listed as _gate


def table() -> str:
    """The table in Markdown, as docs/explanation/discrepancy.md prints it."""
    return markdown(TABLE)


# 1 recordings and channels, before any physics is blamed

SAMPLES_IN_A_RUN: Final = _gate(
    name="samples in a run",
    of="channel",
    statistic="samples of a channel in a row, in a window",
    threshold=8,
    source="fewer say nothing beyond the initial state of the window",
    otherwise="the run is left out; a recording without a run is inconclusive",
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
    otherwise="closer: the channel is left out and the likely heading is named",
    module="checks.channel_checks",
)
OTHER_CLOCK: Final = _gate(
    name="another clock",
    of="channel",
    statistic="misfit at the best shift over the misfit at the shifts that a sensor's delay may explain",
    threshold=0.5,
    source="a shift always helps a little; a wrong clock explains most of the misfit",
    otherwise="lower, with a correlation of 0.8 or more: the channel is left out and the shift is named",
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
    otherwise="the row is set aside, and told",
    module="estimation.set_aside",
)
STRETCH: Final = _gate(
    name="no stretch that nothing explains",
    of="row",
    statistic="root mean square of ten such errors that follow one another, none counted for more than 6",
    threshold=4.0,
    passes="below",
    source="five rows at least have to be large; strong effects of the library, which are taken out to first order only, left up to 3.3",
    otherwise="the ten rows are set aside, and told with their time",
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

# 3 candidate fits and held-out data

NEGLIGIBLE_SIZE: Final = _gate(
    name="size that matters",
    of="effect",
    statistic="largest change of an amplitude parameter that the data still allow, in typical changes, 95 %",
    threshold=0.0,
    unit="or `Model.negligible`",
    source="the author of the model: what an engineer would not look for",
    otherwise="negligible: reported among the candidates, not a finding",
    module="selection.candidate_fits",
)
HELD_OUT_REDUCTION: Final = _gate(
    name="held-out reduction",
    of="effect",
    statistic="reduction in SSE on rows that were not fitted, summed over the folds",
    threshold=4.0,
    source="two standard deviations of one parameter",
    otherwise="the effect is not accepted",
    module="selection.state",
)
HELD_OUT_SHARE: Final = _gate(
    name="held-out share",
    of="effect",
    statistic="held-out reduction, plus the 2 sqrt(g) that chance may take, over the reduction g on fitted rows",
    threshold=0.3,
    source="two folds fit on half of the rows each; white noise gives 0.8 to 1 in the benchmark",
    otherwise="the effect is not accepted; named already, it is the best proxy",
    module="selection.state, decision.caveats",
)
LEAST_EXPLAINED: Final = _gate(
    name="least explained",
    of="effect",
    statistic="share of the squared one-step errors of the channel that the effect helps most, held out",
    threshold=0.0,
    unit="or `Model.least_explained`",
    source="the author of the model: what the model itself is wrong by",
    otherwise="negligible: reported among the candidates, not a finding",
    module="selection.state, selection.open_ended",
)
CLEAR: Final = _gate(
    name="beyond doubt",
    of="effect",
    statistic="reduction in SSE, not divided by the variance inflation",
    threshold=100.0,
    source="ten standard deviations; a wrong noise model is not wrong by that much",
    otherwise="above, with blocks that disagree: the effect is tried together with a second one, and the verdict is unknown if none is found",
    module="selection.search, decision.verdict",
)
BLOCKS_AGREE: Final = _gate(
    name="blocks of time agree",
    of="pair",
    statistic="p-value of the scatter of the effect's size over blocks of time, over the number of candidates",
    threshold=0.02,
    source="the same chance as a false alarm",
    otherwise="the pair is not accepted",
    module="selection.search",
)

# 4 temporary effects

WINDOWS_OF_INTERVAL: Final = _gate(
    name="windows of an active interval",
    of="temporary effect",
    statistic="windows in which the effect acts, and windows in which it does not",
    threshold=3,
    source="fewer have no scatter by which to judge them",
    otherwise="the interval is not tried",
    module="selection.active_intervals",
)
INTERVAL_EVEN: Final = _gate(
    name="even within its interval",
    of="temporary effect",
    statistic="p-value of the scatter of its size over the windows, over the number of candidates",
    threshold=0.02,
    source="the same chance as a false alarm",
    otherwise="the effect is not accepted for that interval",
    module="selection.candidate_fits",
)

# 5 groups

RIVAL_SCORE: Final = _gate(
    name="score of a rival",
    of="group",
    statistic="score in the finding's place before the variance inflation, plus 6, over the finding's reduction in SSE; expensive models only",
    threshold=0.25,
    source="the score of a lag or a friction may be a quarter of what its fit reaches; cheap models fit every rival",
    otherwise="the rival is not fitted, unless the library declares it confusable with the finding",
    module="decision.groups",
)
SAME_LIKELIHOOD: Final = _gate(
    name="same likelihood",
    of="group",
    statistic="SSE of the rival in the finding's place minus SSE of the finding, plus 2 per further parameter",
    threshold=6.0,
    passes="below",
    source="a likelihood ratio of 20",
    otherwise="the rival is no member of the group, unless the next test is passed",
    module="decision.groups",
)
VUONG: Final = _gate(
    name="difference within its own scatter",
    of="group",
    statistic="the same difference over its standard deviation from blocks of time (Vuong 1989)",
    threshold=2.0,
    passes="below",
    source="95 %",
    otherwise="the rival is no member of the group",
    module="decision.groups",
)
RIVAL_KEEPS: Final = _gate(
    name="a rival keeps the reduction",
    of="group",
    statistic="reduction in SSE of the rival over that of the finding",
    threshold=0.5,
    source="half",
    otherwise="the rival is no member of the group",
    module="decision.groups",
)
BOTH_NEEDED: Final = _gate(
    name="a rival makes the finding needless",
    of="group",
    statistic="reduction in SSE by both together beyond the better of the two, over the threshold of one effect",
    threshold=1.0,
    passes="below",
    source="two names of one cause add nothing to one another",
    otherwise="the rival is no member of the group: both may be there",
    module="decision.groups",
)
MANOEUVRE_DECIDES: Final = _gate(
    name="a manoeuvre decides",
    of="group",
    statistic="expected SSE between two rivals, each as fitted, in the manoeuvre",
    threshold=20.0,
    source="three times what counts as the same likelihood",
    otherwise="the manoeuvre is not proposed; the model's own sentence is printed, if there is one",
    module="decision.groups",
)

# 6 names

GAP_CLOSED: Final = _gate(
    name="gap closed",
    of="name",
    statistic="held-out reduction over that of the effect and the open-ended equation together, in the channels it acts on",
    threshold=0.5,
    source="half: 43 of 50 hidden hystereses were named as an effect without this test, 4 of 50 with it",
    otherwise="best proxy, cause unknown",
    module="decision.caveats",
)
CHANNEL_TOUCHED: Final = _gate(
    name="channel acted on",
    of="name",
    statistic="share of the held-out reduction that is in the channel",
    threshold=0.1,
    source="what is left in a channel that the effect does not move says nothing about the effect",
    otherwise="the channel does not count in the gap",
    module="decision.drop_one",
)
DISCRETE_VALUE: Final = _gate(
    name="there or not there",
    of="name",
    statistic="distance of a discrete parameter from its one change, as a share of it",
    threshold=0.25,
    passes="below",
    source="a sign is right or wrong; in between, the recording follows neither",
    otherwise="best proxy, cause unknown; a rival is no member of the group",
    module="decision.groups",
)
AT_BOUND: Final = _gate(
    name="inside the physical bounds",
    of="name",
    statistic="distance of a parameter from its bound, in typical changes",
    threshold=1e-3,
    source="the accuracy of a fit",
    otherwise="best proxy, cause unknown, if an amplitude parameter is at a bound other than its baseline",
    module="decision.summary",
)
OFF_BASELINE: Final = _gate(
    name="off the baseline",
    of="name",
    statistic="distance of each amplitude parameter from its baseline, in half widths of its 95 % interval; not of profiles",
    threshold=1.0,
    source="an effect of which one part may be absent is not determined by the data",
    otherwise="best proxy, cause unknown",
    module="decision.caveats",
)
NOT_CANCELLING: Final = _gate(
    name="two names that do not cancel",
    of="name",
    statistic="change of the outputs by two findings together, over the smaller change by one of them alone",
    threshold=0.3,
    source="a lag of 0.28 s and a delay of -0.28 s leave a remainder of second order",
    otherwise="both are best proxies, cause unknown",
    module="decision.caveats",
)
PRIOR_CONFLICT: Final = _gate(
    name="no prior conflict",
    of="name",
    statistic="distance of a nuisance from its prior, in standard deviations of the prior",
    threshold=3.0,
    passes="below",
    source="one in 370",
    otherwise="effects are screened from the prior too; a name beside it is the best proxy, cause unknown",
    module="selection.assess, decision.caveats",
)
LEFT_BESIDE_EQUATION: Final = _gate(
    name="size left beside the equation",
    of="name",
    statistic="share of its size that an effect keeps beside the open-ended equation",
    threshold=0.5,
    source="half",
    otherwise="best proxy, cause unknown, where what is left is not significant and the equation in its place does as well",
    module="decision.caveats",
)
NUISANCE_IN_TIME: Final = _gate(
    name="no nuisance that changes in time",
    of="name",
    statistic="score of a nuisance that is another in an interval over the reduction in SSE of the temporary effect, less 6",
    threshold=0.98,
    passes="below",
    source="2 % is the error of the linear forecast",
    otherwise="best proxy, cause unknown",
    module="decision.caveats",
)

# 7 equation outside the library

EQUATION_SEEN: Final = _gate(
    name="term beyond chance",
    of="equation",
    statistic="p-value of the reduction in SSE, over variance inflation, over the number of terms tried",
    threshold=0.02,
    passes="below",
    source="the same chance as a false alarm",
    otherwise="no term is added",
    module="selection.open_ended",
)
EQUATION_HELD_OUT: Final = _gate(
    name="term on held-out data",
    of="equation",
    statistic="held-out reduction of all terms, less 0.3 of the reduction by the earlier terms",
    threshold=4.0,
    source="as for an effect",
    otherwise="no term is added",
    module="selection.open_ended",
)

# 8 adequacy: is the model good enough, whatever is named

ONE_STEP_OVER: Final = _gate(
    name="one-step error within budget",
    of="channel",
    statistic="one-step error at the end over the error budget, where that is from the sensor's sheet",
    threshold=1.2,
    passes="below",
    source="on 33 recordings with known sensors: above it lay every missed strong effect and no right name; few samples: 2 % of Fisher's F over all channels",
    otherwise="the channel is not adequate: *explained* becomes *explained in part*, *nothing missing* becomes *unknown*",
    module="decision.adequacy",
)
DISTURBANCE_SHARE: Final = _gate(
    name="share of the movement for disturbances",
    of="channel",
    statistic="what unmeasured disturbances may add to the error of a simulation, over the movement of the channel beyond its initial states",
    threshold=0.1,
    unit="or `Model.disturbances`",
    passes="below",
    source="an engineer's simulation follows nine tenths of a movement; coloured disturbances in the nulls of the benchmark add 0.04 at most",
    otherwise="as for the next test",
    module="decision.adequacy, checks.budgets",
)
SIMULATED_OVER: Final = _gate(
    name="error of the simulation within budget",
    of="channel",
    statistic="error of the simulation, initial states free in every window, over the root of the squared sensor budget and the squared share for disturbances",
    threshold=1.2,
    passes="below",
    source="as for one-step errors; the samples count as far as their errors are independent",
    otherwise="the channel is not adequate: *explained* becomes *explained in part*, *nothing missing* becomes *unknown*",
    module="decision.adequacy",
)
PART_OVER: Final = _gate(
    name="no part of the time beyond budget",
    of="channel",
    statistic="either error in a twentieth of a recording's time, or in a third of the range of a known signal, over its budget",
    threshold=2.0,
    passes="below",
    source="errors are uneven in time: nulls with coloured disturbances reach 0.8 of a budget; few samples: 2 % of Fisher's F over all parts",
    otherwise="the channel is not adequate, and the part is said",
    module="decision.adequacy",
)

# 9 verdict

NAMED_SHARE: Final = _gate(
    name="nine tenths have a name",
    of="verdict",
    statistic="held-out reduction by named effects over that by all findings and the open-ended equation together",
    threshold=0.9,
    source="the gap that a named effect has to close in the benchmark, median; a tenth is what an equation of first order leaves of a strong effect",
    otherwise="*explained* becomes *explained in part*",
    module="decision.verdict",
)

SAMPLES_TO_JUDGE: Final = _gate(
    name="samples to judge",
    of="verdict",
    statistic="samples of all channels",
    threshold=30,
    source="a one-parameter effect of typical size needs about as many",
    otherwise="inconclusive",
    module="decision.verdict",
)
POWER: Final = _gate(
    name="power",
    of="verdict",
    statistic="chance that an effect of typical size would have been found",
    threshold=0.8,
    source="convention (Cohen 1988)",
    otherwise="the effect could not be judged; if that holds for all of the library: inconclusive",
    module="decision.summary",
)
CONFOUNDED: Final = _gate(
    name="confounded with nuisances",
    of="effect",
    statistic="share of the effect that refitted nuisances can do",
    threshold=0.5,
    passes="below",
    source="from half on, the linear share promises more than a refit leaves",
    otherwise="its power is that of a refit without it",
    module="decision.detectability",
)
COLLINEAR_NUISANCE: Final = _gate(
    name="collinear with nuisances",
    of="effect",
    statistic="the same share",
    threshold=0.95,
    passes="below",
    source="no driving tells them apart; another channel may",
    otherwise="could not be judged, and the reason names another channel, not more data",
    module="decision.summary",
)
RECORDINGS_AGREE: Final = _gate(
    name="recordings agree",
    of="verdict",
    statistic="p-value of the analysis of variance of an effect's size over recordings",
    threshold=1e-3,
    source="recordings of one machine on different days differ a little in any case",
    otherwise="below, and apart by the next threshold: a sentence in the reasons",
    module="decision.agreement",
)
RECORDINGS_APART: Final = _gate(
    name="recordings differ enough",
    of="verdict",
    statistic="range of the size over recordings, as a share of the size",
    threshold=0.1,
    source="a tenth matters to an engineer",
    otherwise="smaller: nothing is said",
    module="decision.agreement",
)
CHANNEL_NOTABLE: Final = _gate(
    name="a missing channel would help",
    of="verdict",
    statistic="change of the channel by the effect, as a share of the channel's own movement",
    threshold=0.02,
    source="sensors resolve a hundredth or so",
    otherwise="the effect is not listed under the missing channel",
    module="decision.missing_channels",
)

"""Gates of groups, names and equations outside the library."""

from typing import Final

from discrepancy.gates.gate import listed as _gate

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
    threshold=9.2,
    passes="below",
    source="a likelihood ratio of 100: a wrong name is ahead of the right one by more in at most 1 of 100 recordings",
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
BOTH_NEEDED: Final = _gate(
    name="a rival makes the finding needless",
    of="group",
    statistic="reduction in SSE by both together beyond the better of the two, over the threshold of one effect",
    threshold=1.0,
    passes="below",
    source="two names of one cause add nothing to one another",
    otherwise="the rival is no member of the group, unless it has the same likelihood: both may be there",
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
MANOEUVRE_DECIDES: Final = _gate(
    name="a manoeuvre decides",
    of="group",
    statistic="expected difference in SSE between two rivals in the manoeuvre, after a fit of one to the other",
    threshold=20.0,
    source="twice what counts as the same likelihood",
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
EQUATION_ERROR: Final = _gate(
    name="more than the equation may leave",
    of="name",
    statistic="evidence of an effect beside an equation in the baseline, over that of the equation; of an effect that was found without the equation too, times the share of the effect that the equation can do",
    threshold=0.1,
    source="a tenth is what an equation of first order leaves of a strong effect",
    otherwise="best proxy, cause unknown: it may be what the equation leaves of its own",
    module="decision.again.beside",
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
OWN_READING: Final = _gate(
    name="a sensor's own reading",
    of="name",
    statistic="held-out error of the reading that a sensor's fault changes, over that without the fault",
    threshold=1.0,
    passes="below",
    source="a fault of a sensor is in its reading first; a model that is driven by the reading passes what is wrong with it on to all others",
    otherwise="best proxy, cause unknown",
    module="decision.caveats",
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
    otherwise="best proxy, cause unknown, if an amplitude parameter is at a bound other than its baseline; of a sensor's fault also if the 95 % interval of one fit of all recordings reaches beyond it",
    module="decision.summary",
)
AT_BOUND_SD: Final = _gate(
    name="inside the physical bounds, beside the accuracy of a fit",
    of="name",
    statistic="distance of a parameter from its bound, in standard deviations; where that is less than a tenth of a typical change",
    threshold=0.1,
    source="a fit ends where a step promises less than 0.01 in SSE, which is a tenth of a standard deviation",
    otherwise="as above",
    module="decision.summary",
)
OFF_BASELINE: Final = _gate(
    name="off the baseline",
    of="name",
    statistic="distance of each amplitude parameter from its baseline, in half widths of its 95 % interval with the effect's shapes held; not of profiles",
    threshold=1.0,
    source="an effect of which one part may be absent is not determined by the data",
    otherwise="best proxy, cause unknown",
    module="decision.caveats",
)
ABSENT_PART: Final = _gate(
    name="a part that is absent",
    of="name",
    statistic="farthest value of the 95 % interval of an amplitude parameter from its baseline, over the effect's largest amplitude, both in typical changes",
    threshold=0.1,
    passes="below",
    source="a tenth: what is certainly absent is determined, and the rest is an effect with one parameter less: brakes that drag at one axle",
    otherwise="the parameter has to be off its baseline and inside its bounds",
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
    otherwise="effects are screened from the prior too; where the interval of the nuisance is beyond two of them, the search goes on with a prior ten times wider if the model is then adequate, else a name beside it is the best proxy, cause unknown",
    module="selection.assess, decision.caveats, decision.summary",
)
RATES_AGREE: Final = _gate(
    name="sizes at both rates agree",
    of="effect",
    statistic="difference of a size by single samples and by rows at the model's bandwidth, over the root of the difference of their variances (Hausman 1978); only where eight samples or more make a row",
    threshold=2.0,
    passes="below",
    source="95 %",
    otherwise="a sentence says so; the interval holds both in any case",
    module="decision.rates",
)
LEFT_BESIDE_EQUATION: Final = _gate(
    name="size left beside the equation",
    of="name",
    statistic="share of its size that an effect keeps beside the open-ended equation",
    threshold=0.5,
    source="half: a size that another cause would halve is not determined; where both sizes were fitted, one that changes by half of itself, either way",
    otherwise="best proxy, cause unknown",
    module="decision.caveats, decision.again.beside",
)
HANGS_ON_A_VALUE: Final = _gate(
    name="own size beside a value of the sheet",
    of="name",
    statistic="change of an effect's size, over that size, if a baseline value that contradicts its sheet is put at the edge of what the sheet allows; where a function of known signals still has the evidence of a term",
    threshold=1.0,
    passes="below",
    source="itself: beyond it even the effect's sign is that of the wrong value; a leak beside a wrong area changes by 0.5 to 0.9, a bias that stands for natural convection by 2.5 to 5.6",
    otherwise="best proxy, cause unknown, and the value is not sure",
    module="decision.caveats",
)
HANGS_ON_A_PROXY: Final = _gate(
    name="a size of its own beside proxies",
    of="name",
    statistic="change of an effect's size, over that size, to first order, if the best proxies are taken out",
    threshold=1.0,
    passes="below",
    source="itself: beyond it even the effect's sign is that of the proxies; a bias of an accelerometer of -2.2 m/s² (true 1.0) beside a scale at its bound changes by 1.8",
    otherwise="best proxy, cause unknown",
    module="decision.sizes.without_proxies",
)
SEEN_BESIDE_REST: Final = _gate(
    name="seen beside what is left over",
    of="name",
    statistic="share of the squared one-step error on held-out data that an effect takes off the channel that it improves most, while it acts; where the model does not simulate to twice the error of a reading, or within disturbances that it states",
    threshold=0.01,
    source="false names on outside engineers' machines took 0.6 % off; an effect of lambda 50 takes 1 to 2 % of a channel of 2400 rows",
    otherwise="the next test has to be passed",
    module="decision.caveats",
)
CLEAR_BESIDE_REST: Final = _gate(
    name="clear beside what is left over",
    of="name",
    statistic="reduction in SSE by such an effect",
    threshold=50,
    source="the lambda from which the benchmark expects a name",
    otherwise="best proxy, cause unknown",
    module="decision.caveats",
)
IMITATED_BESIDE_REST: Final = _gate(
    name="distinct beside what is left over",
    of="name",
    statistic="share of an effect that nuisances can do, where the model is as above",
    threshold=0.97,
    passes="below",
    source="then a sixth of its change of the outputs is its own, and an error of a law that is a sixth as large can be its own as well",
    otherwise="the next test has to be passed",
    module="decision.caveats",
)
MUCH_BESIDE_REST: Final = _gate(
    name="much beside what is left over",
    of="name",
    statistic="share of the squared one-step error on held-out data that such an effect takes off the channel that it improves most, while it acts",
    threshold=0.25,
    source="a quarter; right names of outside engineers' machines took 28 % and more off, stand-ins 2 to 18 %",
    otherwise="best proxy, cause unknown",
    module="decision.caveats",
)
MATTERS_IN_A_WRONG_MODEL: Final = _gate(
    name="large enough to matter in a wrong model",
    of="name",
    statistic="of a sensor's fault, the largest size that the 95 % interval allows, over the smallest change that matters (`typical`); where errors are over budget, or a proxy or an equation is left",
    threshold=0.1,
    source="as `Model.negligible` of the loader; a pendulum that swings for minutes shows an error of its encoder of 0.03 %, where 3 % mattered",
    otherwise="best proxy, cause unknown",
    module="decision.sizes.of_a_wrong_model",
)
DELAY_MIRRORED: Final = _gate(
    name="a delay is one way",
    of="name",
    statistic="reduction in SSE by a delay of the other sign, over that of the delay; not for expensive models",
    threshold=0.5,
    passes="below",
    source="a shift by half a sample averages the noise of two samples of an input, whichever way it goes: 79 to 101 % on an outside engineer's robot, below 0 for its right delays",
    otherwise="best proxy, cause unknown",
    module="decision.caveats",
)
LEFT_BESIDE_UNACCEPTED: Final = _gate(
    name="evidence left beside an effect that was not accepted",
    of="name",
    statistic="share of its evidence that an effect keeps beside one that was not accepted and reduces the SSE more",
    threshold=0.5,
    source="half: what another law would mostly do is not determined, although held-out data contradict that law or the search ended before it",
    otherwise="best proxy, cause unknown",
    module="decision.not_accepted",
)
NUISANCE_CHANGED: Final = _gate(
    name="a nuisance that may have changed",
    of="name",
    statistic="distance from its prior, in standard deviations, of the value that a nuisance would need for a while",
    threshold=10.0,
    passes="below",
    source="a load may be taken up that the sheet does not know; ten times what a sheet is wrong by is another law",
    otherwise="above, or beyond its bounds, it is no rival of a temporary effect",
    module="selection.active_intervals",
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
LAG_UNDONE: Final = _gate(
    name="a lag that is undone",
    of="name",
    statistic="early stamp of a reading over the lag of the same reading, where both are accepted",
    threshold=0.5,
    passes="below",
    source="of a lag that is half made good, the size is the early stamp's as much as its own",
    otherwise="the lag is the best proxy, as the early stamp is in any case",
    module="decision.caveats",
)

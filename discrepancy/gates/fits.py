"""Gates of candidate fits, held-out data and temporary effects."""

from typing import Final

from discrepancy.gates.gate import listed as _gate

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
    otherwise="above, with blocks that disagree: the effect is tried together with a second one; if that does not help, it is not called ruled out, and the verdict is unknown, or explained in part beside findings",
    module="selection.starts, selection.candidate_fits, selection.search, decision.verdict, decision.summary",
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
STRONG: Final = _gate(
    name="strong enough to be hidden",
    of="effect",
    statistic="share of the squared error of a simulation that the effect removes",
    threshold=0.5,
    source="half: beside a late pump, which is in no library, other effects remove a tenth and would pass the next tests",
    otherwise="it is not tried under the noise that it leaves itself",
    module="selection.own_noise",
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
    statistic="p-value of the scatter of its size over the windows inside, beside the scatter about zero outside (Fisher's F), over the number of candidates",
    threshold=0.02,
    source="the same chance as a false alarm",
    otherwise="the effect is not accepted for that interval",
    module="selection.candidate_fits",
)

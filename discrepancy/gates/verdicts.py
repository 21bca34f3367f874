"""Gates of adequacy and of the verdict."""

from typing import Final

from discrepancy.gates.gate import listed as _gate

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
SIMULATED_WORSE: Final = _gate(
    name="simulated no worse",
    of="verdict",
    statistic="simulated error of a channel with windows cut where effects begin and end, over that with whole windows",
    threshold=1.05,
    passes="below",
    source="the root mean square of 200 errors scatters by 5 %",
    otherwise="the verdict with whole windows stays",
    module="decision.again.times",
)
CERTAIN_VALUE: Final = _gate(
    name="simulated as well as measured",
    of="verdict",
    statistic="error of the simulation over that of a reading, by its budget or one step ahead, where the model states no disturbances of the channel",
    threshold=2.0,
    passes="below",
    source="nulls have 0.8 to 1.1; a tenth of the movement, which is granted where nothing is stated, hid a yaw damping of another law, 2.7 times",
    otherwise="no value of the sheet is certain to be wrong",
    module="decision.adequacy",
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
    otherwise="the channel is not adequate, and the part is reported",
    module="decision.adequacy",
)


# 9 verdict


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
    module="decision.sizes.detectability",
)
COLLINEAR_NUISANCE: Final = _gate(
    name="collinear with nuisances",
    of="effect",
    statistic="the same share",
    threshold=0.95,
    passes="below",
    source="no manoeuvre distinguishes them; another channel may",
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
    otherwise="smaller: nothing is reported",
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

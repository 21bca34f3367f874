"""The wheel loader as a model: the plant replayed from its measured inputs, and the effects that a diagnosis may find.

model            the Model that the engine gets
channels         inputs and outputs with their units
nuisances        values that the machine's sheet does not know exactly
library          effects of the plant and faults of the sensors
segments         which parts of a recording are simulated and scored
replay_inputs    measured inputs, free of what their sensors did to them
warm_up          the motion before a segment, which gives its initial state
initial_states   what remains unknown of an initial state
window_start     initial states of all segments of a recording
contact_detection  where the machine drove into something
parallel         the replay of many segments on all processors
machine_variant  the sheet's machine with changed parameters and effects
simulation       the function of the model
recorded_run     a run directory of the bench as a recording
"""

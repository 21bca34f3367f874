def test_a_signal_is_seen_on_the_bus(rig):
    rig.stimulate("EngineData.Rpm", 2500)
    rig.expect("EngineData.Rpm == 2500", within_s=1.0)


def test_a_signal_stays_in_its_range(rig):
    rig.stimulate("EngineData.Rpm", 1500)
    rig.holds("EngineData.Rpm <= 8000", for_s=0.1)


def test_several_signals_of_a_message(rig):
    for signal, value in {"Rpm": 3000, "CoolantTemp": 90, "ThrottlePosition": 24}.items():
        rig.stimulate(f"EngineData.{signal}", value)
        rig.expect(f"EngineData.{signal} == {value}", within_s=1.0)

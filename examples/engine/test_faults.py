import pytest

from testbench.api import NotMet


def test_a_message_is_absent_during_a_dropout_and_back_after_it(rig):
    rig.stimulate("EngineData.Rpm", 800)
    rig.expect("EngineData.Rpm == 800", within_s=1.0)
    rig.inject(kind="drop", message="EngineData")
    rig.run_for(0.05)
    with pytest.raises(NotMet, match=r"no EngineData\.Rpm came"):
        rig.holds("EngineData.Rpm >= 0", for_s=0.2)
    rig.clear()
    rig.holds("EngineData.Rpm >= 0", for_s=0.1)


def test_the_bus_is_healthy_after_a_power_cycle(make_bench):
    bench = make_bench("standstill")
    bench.run_for(0.5)
    bench.inject(kind="kill", process="ecu", for_s=0.2)
    bench.run_for(0.3)
    bench.expect("Limits.Cause != safe_values", within_s=2.0)


def test_an_override_lasts_until_it_is_cleared(rig):
    rig.expect("EngineData.Rpm == 0", within_s=1.0)
    rig.stimulate("EngineData.Rpm", 5500)
    rig.expect("EngineData.Rpm == 5500", within_s=1.0)
    rig.clear()
    rig.expect("EngineData.Rpm == 0", within_s=1.0)

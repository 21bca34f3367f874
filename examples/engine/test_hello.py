def test_the_bench_runs(rig):
    rig.run_for(0.05)
    assert rig.frames


def test_an_ecu_comes_back_after_a_power_cycle(make_bench):
    bench = make_bench("standstill")
    bench.wait_for("EcuStatus.State == running", within_s=1.0)
    bench.inject(kind="kill", process="ecu", for_s=0.2)
    bench.run_for(0.3)
    bench.expect("EcuStatus.State == running", within_s=1.0)

*** Settings ***
Documentation     A simulated engine on a bus inside this process, and the bench's own ECU. `robot examples/engine/engine.robot`
Library           testbench.robot_library.BenchLibrary

*** Test Cases ***
A Signal Is Seen On The Bus
    Start Rest Bus    virtual:engine    Engine    dbc=${CURDIR}/engine.dbc
    Stimulate    EngineData.Rpm    2500
    Expect    EngineData.Rpm == 2500    within=1 s
    Holds    EngineData.Rpm <= 8000    during=100 ms

A Message Is Absent During A Dropout And Back After It
    Start Rest Bus    virtual:engine    Engine    dbc=${CURDIR}/engine.dbc
    Inject    drop    message=EngineData
    Run For    50 ms
    Run Keyword And Expect Error    *no EngineData.Rpm came*    Holds    EngineData.Rpm >= 0    during=200 ms
    Clear Faults
    Holds    EngineData.Rpm >= 0    during=100 ms

An ECU Comes Back After A Power Cycle
    Start Bench    standstill
    Wait For    EcuStatus.State == running    within=1 s
    Inject    kill    process=ecu    for_s=0.2
    Run For    300 ms
    Expect    EcuStatus.State == running    within=1 s

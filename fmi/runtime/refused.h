/* What a slave for co-simulation alone answers to the rest of FMI 2.0 or 3.0 (-DFMI=2, -DFMI=3): an importing tool looks for every function,
   and a slave whose variables are all doubles refuses most of them. */
#if FMI == 2
#include "fmi2Functions.h"
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
#define NOT(name, ...) fmi2Status name(fmi2Component c, __VA_ARGS__) { (void)c; return fmi2Error; }
NOT(fmi2GetInteger, const fmi2ValueReference vr[], size_t n, fmi2Integer x[])
NOT(fmi2GetBoolean, const fmi2ValueReference vr[], size_t n, fmi2Boolean x[])
NOT(fmi2GetString, const fmi2ValueReference vr[], size_t n, fmi2String x[])
NOT(fmi2SetInteger, const fmi2ValueReference vr[], size_t n, const fmi2Integer x[])
NOT(fmi2SetBoolean, const fmi2ValueReference vr[], size_t n, const fmi2Boolean x[])
NOT(fmi2SetString, const fmi2ValueReference vr[], size_t n, const fmi2String x[])
NOT(fmi2GetFMUstate, fmi2FMUstate *f)
NOT(fmi2SetFMUstate, fmi2FMUstate f)
NOT(fmi2FreeFMUstate, fmi2FMUstate *f)
NOT(fmi2SerializedFMUstateSize, fmi2FMUstate f, size_t *n)
NOT(fmi2SerializeFMUstate, fmi2FMUstate f, fmi2Byte b[], size_t n)
NOT(fmi2DeSerializeFMUstate, const fmi2Byte b[], size_t n, fmi2FMUstate *f)
NOT(fmi2GetDirectionalDerivative, const fmi2ValueReference u[], size_t n, const fmi2ValueReference k[], size_t m, const fmi2Real d[], fmi2Real e[])
NOT(fmi2SetRealInputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], const fmi2Real x[])
NOT(fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], fmi2Real x[])
NOT(fmi2GetStatus, const fmi2StatusKind k, fmi2Status *x)
NOT(fmi2GetRealStatus, const fmi2StatusKind k, fmi2Real *x)
NOT(fmi2GetIntegerStatus, const fmi2StatusKind k, fmi2Integer *x)
NOT(fmi2GetBooleanStatus, const fmi2StatusKind k, fmi2Boolean *x)
NOT(fmi2GetStringStatus, const fmi2StatusKind k, fmi2String *x)
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }
#else
#include "fmi3Functions.h"
const char *fmi3GetVersion(void) { return fmi3Version; }
fmi3Instance fmi3InstantiateModelExchange(fmi3String a, fmi3String b, fmi3String p, fmi3Boolean v, fmi3Boolean l,
                                          fmi3InstanceEnvironment e, fmi3LogMessageCallback log) { return NULL; }
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String a, fmi3String b, fmi3String p, fmi3Boolean v, fmi3Boolean l,
                                               fmi3InstanceEnvironment e, fmi3LogMessageCallback log, fmi3ClockUpdateCallback u,
                                               fmi3LockPreemptionCallback k, fmi3UnlockPreemptionCallback n) { return NULL; }
#define NOT(name, ...) fmi3Status name(fmi3Instance c, __VA_ARGS__) { (void)c; return fmi3Error; }
#define NONE(name) fmi3Status name(fmi3Instance c) { (void)c; return fmi3Error; }
#define TYPED(T, kind) \
    NOT(fmi3Get##T, const fmi3ValueReference vr[], size_t n, kind x[], size_t m) \
    NOT(fmi3Set##T, const fmi3ValueReference vr[], size_t n, const kind x[], size_t m)
TYPED(Float32, fmi3Float32) TYPED(Int8, fmi3Int8) TYPED(UInt8, fmi3UInt8) TYPED(Int16, fmi3Int16) TYPED(UInt16, fmi3UInt16)
TYPED(Int32, fmi3Int32) TYPED(UInt32, fmi3UInt32) TYPED(Int64, fmi3Int64) TYPED(UInt64, fmi3UInt64)
TYPED(Boolean, fmi3Boolean) TYPED(String, fmi3String)
NOT(fmi3GetBinary, const fmi3ValueReference vr[], size_t n, size_t s[], fmi3Binary x[], size_t m)
NOT(fmi3SetBinary, const fmi3ValueReference vr[], size_t n, const size_t s[], const fmi3Binary x[], size_t m)
NOT(fmi3GetClock, const fmi3ValueReference vr[], size_t n, fmi3Clock x[])
NOT(fmi3SetClock, const fmi3ValueReference vr[], size_t n, const fmi3Clock x[])
NOT(fmi3GetNumberOfVariableDependencies, fmi3ValueReference vr, size_t *n)
NOT(fmi3GetVariableDependencies, fmi3ValueReference d, size_t a[], fmi3ValueReference b[], size_t e[], fmi3DependencyKind k[], size_t n)
NOT(fmi3GetFMUState, fmi3FMUState *f)
NOT(fmi3SetFMUState, fmi3FMUState f)
NOT(fmi3FreeFMUState, fmi3FMUState *f)
NOT(fmi3SerializedFMUStateSize, fmi3FMUState f, size_t *n)
NOT(fmi3SerializeFMUState, fmi3FMUState f, fmi3Byte b[], size_t n)
NOT(fmi3DeserializeFMUState, const fmi3Byte b[], size_t n, fmi3FMUState *f)
NOT(fmi3GetDirectionalDerivative, const fmi3ValueReference u[], size_t n, const fmi3ValueReference k[], size_t m, const fmi3Float64 s[], size_t o, fmi3Float64 e[], size_t p)
NOT(fmi3GetAdjointDerivative, const fmi3ValueReference u[], size_t n, const fmi3ValueReference k[], size_t m, const fmi3Float64 s[], size_t o, fmi3Float64 e[], size_t p)
NONE(fmi3EnterConfigurationMode) NONE(fmi3ExitConfigurationMode) NONE(fmi3EnterEventMode) NONE(fmi3EnterStepMode)
NONE(fmi3EnterContinuousTimeMode) NONE(fmi3EvaluateDiscreteStates)
NOT(fmi3GetIntervalDecimal, const fmi3ValueReference vr[], size_t n, fmi3Float64 x[], fmi3IntervalQualifier q[])
NOT(fmi3GetIntervalFraction, const fmi3ValueReference vr[], size_t n, fmi3UInt64 x[], fmi3UInt64 y[], fmi3IntervalQualifier q[])
NOT(fmi3GetShiftDecimal, const fmi3ValueReference vr[], size_t n, fmi3Float64 x[])
NOT(fmi3GetShiftFraction, const fmi3ValueReference vr[], size_t n, fmi3UInt64 x[], fmi3UInt64 y[])
NOT(fmi3SetIntervalDecimal, const fmi3ValueReference vr[], size_t n, const fmi3Float64 x[])
NOT(fmi3SetIntervalFraction, const fmi3ValueReference vr[], size_t n, const fmi3UInt64 x[], const fmi3UInt64 y[])
NOT(fmi3SetShiftDecimal, const fmi3ValueReference vr[], size_t n, const fmi3Float64 x[])
NOT(fmi3SetShiftFraction, const fmi3ValueReference vr[], size_t n, const fmi3UInt64 x[], const fmi3UInt64 y[])
NOT(fmi3UpdateDiscreteStates, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e, fmi3Boolean *f, fmi3Float64 *t)
NOT(fmi3GetOutputDerivatives, const fmi3ValueReference vr[], size_t n, const fmi3Int32 o[], fmi3Float64 x[], size_t m)
NOT(fmi3CompletedIntegratorStep, fmi3Boolean no, fmi3Boolean *a, fmi3Boolean *b)
NOT(fmi3SetTime, fmi3Float64 t)
NOT(fmi3SetContinuousStates, const fmi3Float64 x[], size_t n)
NOT(fmi3GetContinuousStateDerivatives, fmi3Float64 x[], size_t n)
NOT(fmi3GetEventIndicators, fmi3Float64 x[], size_t n)
NOT(fmi3GetContinuousStates, fmi3Float64 x[], size_t n)
NOT(fmi3GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n)
NOT(fmi3GetNumberOfEventIndicators, size_t *n)
NOT(fmi3GetNumberOfContinuousStates, size_t *n)
NOT(fmi3ActivateModelPartition, fmi3ValueReference r, fmi3Float64 t)
#endif

/* A co-simulation slave of FMI 2.0 or 3.0 (-DFMI=2, -DFMI=3) whose model is a process: Python with loaderhil.

   Python stays in a process of its own, so that the importing tool needs no Python library, and its threads and signals meet none of ours.
   Values are doubles: PARAMETERS, then INPUTS, then OUTPUTS; a value reference is a place among them; the first ones are in start.h.
   Both sides are on one computer, so numbers cross as they are. To the process: 'S' and the parameters; 'D', time, step and the inputs.
   From it: 0 and the outputs; or 1, a 4-byte length and a text. */
#define _GNU_SOURCE
#include <errno.h>
#include <spawn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#if FMI == 2
#include "fmi2Functions.h"
#define ERROR fmi2Error
#else
#include "fmi3Functions.h"
#define ERROR fmi3Error
#endif
#include "start.h"

#define COUNT (PARAMETERS + INPUTS + OUTPUTS)
extern char **environ;

typedef struct {
    double v[COUNT];
    char resources[4096];
    int line; /* to the process; -1: none */
    pid_t process;
#if FMI == 2
    const fmi2CallbackFunctions *callbacks;
#else
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
#endif
} Slave;

static const double start[PARAMETERS + INPUTS] = START;

static int fail(Slave *s, const char *text) {
#if FMI == 2
    if (s->callbacks && s->callbacks->logger)
        s->callbacks->logger(s->callbacks->componentEnvironment, "loaderhil", fmi2Error, "logStatusError", "%s", text);
#else
    if (s->log) s->log(s->environment, fmi3Error, "logStatusError", text);
#endif
    return ERROR;
}

static int sent(int line, const void *from, size_t n) {
    for (const char *p = from; n > 0;) {
        ssize_t k = send(line, p, n, MSG_NOSIGNAL);
        if (k < 0 && errno == EINTR) continue;
        if (k <= 0) return 0;
        p += k;
        n -= k;
    }
    return 1;
}

static int received(int line, void *into, size_t n) {
    for (char *p = into; n > 0;) {
        ssize_t k = recv(line, p, n, 0);
        if (k < 0 && errno == EINTR) continue;
        if (k <= 0) return 0;
        p += k;
        n -= k;
    }
    return 1;
}

static void end(Slave *s) {
    if (s->line < 0) return;
    close(s->line); /* the process ends when its line does */
    s->line = -1;
    waitpid(s->process, NULL, 0);
}

/* The Python of $LOADERHIL_PYTHON, else the one that exported this FMU, else that of the path. */
static int begin(Slave *s) {
    int pair[2];
    const char *python = getenv("LOADERHIL_PYTHON");
    if (!python) python = access(PYTHON, X_OK) == 0 ? PYTHON : "python3";
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair)) return fail(s, "no socket for the process of the plant");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, pair[1], 0);
    char *words[] = {(char *)python, "-m", "fmi.slave", s->resources, NULL};
    int bad = posix_spawnp(&s->process, python, &actions, NULL, words, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(pair[1]);
    if (bad) {
        close(pair[0]);
        return fail(s, "no Python with loaderhil: name one by LOADERHIL_PYTHON");
    }
    s->line = pair[0];
    return 0;
}

static int answered(Slave *s) {
    char status, text[1024];
    uint32_t size;
    if (!received(s->line, &status, 1)) {
        end(s);
        return fail(s, "the process of the plant ended; is LOADERHIL_PYTHON a Python with loaderhil?");
    }
    if (status == 0) return received(s->line, s->v + PARAMETERS + INPUTS, OUTPUTS * sizeof(double)) ? 0 : fail(s, "the process of the plant ended");
    if (!received(s->line, &size, 4) || size >= sizeof text || !received(s->line, text, size)) return fail(s, "the process of the plant ended");
    text[size] = 0;
    return fail(s, text);
}

static int started(Slave *s) {
    if (s->line < 0 && begin(s)) return ERROR;
    char call = 'S';
    if (!sent(s->line, &call, 1) || !sent(s->line, s->v, PARAMETERS * sizeof(double))) {
        end(s);
        return fail(s, "the process of the plant ended; is LOADERHIL_PYTHON a Python with loaderhil?");
    }
    return answered(s);
}

static int stepped(Slave *s, double t, double h) {
    char call = 'D';
    double when[2] = {t, h};
    if (s->line < 0 || !sent(s->line, &call, 1) || !sent(s->line, when, sizeof when) ||
        !sent(s->line, s->v + PARAMETERS, INPUTS * sizeof(double)))
        return fail(s, "the process of the plant ended");
    return answered(s);
}

static Slave *fresh(const char *resources) {
    Slave *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    memcpy(s->v, start, sizeof start);
    s->line = -1;
    if (resources) {
        if (!strncmp(resources, "file://", 7)) resources += 7;
        else if (!strncmp(resources, "file:", 5)) resources += 5;
        char *to = s->resources, *last = s->resources + sizeof s->resources - 1;
        for (unsigned code; *resources && to < last; ++to) {
            if (*resources == '%' && sscanf(resources + 1, "%2x", &code) == 1) { *to = (char)code; resources += 3; }
            else *to = *resources++;
        }
    }
    return s;
}

static void freed(Slave *s) {
    if (!s) return;
    end(s);
    free(s);
}

static int again(Slave *s) {
    memset(s->v, 0, sizeof s->v);
    memcpy(s->v, start, sizeof start);
    return 0;
}

static int put(Slave *s, const unsigned *vr, size_t n, const double *x) {
    for (size_t i = 0; i < n; ++i) {
        if (vr[i] >= PARAMETERS + INPUTS) return fail(s, "an output cannot be set");
        s->v[vr[i]] = x[i];
    }
    return 0;
}

static int get(Slave *s, const unsigned *vr, size_t n, double *x) {
    for (size_t i = 0; i < n; ++i) {
        if (vr[i] >= COUNT) return fail(s, "there is no such value reference");
        x[i] = s->v[vr[i]];
    }
    return 0;
}

#if FMI == 2
#define NOT(name, ...) fmi2Status name(fmi2Component c, __VA_ARGS__) { (void)c; return fmi2Error; }
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String k[]) { return fmi2OK; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean on) {
    Slave *s = fresh(resources);
    if (s) s->callbacks = callbacks;
    return s;
}
void fmi2FreeInstance(fmi2Component c) { freed(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real t, fmi2Real a, fmi2Boolean e, fmi2Real b) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return started(c); }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return again(c); }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real x[]) { return get(c, vr, n, x); }
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real x[]) { return put(c, vr, n, x); }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no) { return stepped(c, t, h); }
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
#define NOT(name, ...) fmi3Status name(fmi3Instance c, __VA_ARGS__) { (void)c; return fmi3Error; }
#define NONE(name) fmi3Status name(fmi3Instance c) { (void)c; return fmi3Error; }
#define TYPED(T, kind) \
    NOT(fmi3Get##T, const fmi3ValueReference vr[], size_t n, kind x[], size_t m) \
    NOT(fmi3Set##T, const fmi3ValueReference vr[], size_t n, const kind x[], size_t m)
const char *fmi3GetVersion(void) { return fmi3Version; }
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String k[]) { return fmi3OK; }
fmi3Instance fmi3InstantiateModelExchange(fmi3String a, fmi3String b, fmi3String p, fmi3Boolean v, fmi3Boolean l,
                                          fmi3InstanceEnvironment e, fmi3LogMessageCallback log) { return NULL; }
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String a, fmi3String b, fmi3String p, fmi3Boolean v, fmi3Boolean l,
                                               fmi3InstanceEnvironment e, fmi3LogMessageCallback log, fmi3ClockUpdateCallback u,
                                               fmi3LockPreemptionCallback k, fmi3UnlockPreemptionCallback n) { return NULL; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible, fmi3Boolean on,
                                         fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference r[], size_t n,
                                         fmi3InstanceEnvironment e, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback u) {
    Slave *s = fresh(path);
    if (s) { s->log = log; s->environment = e; }
    return s;
}
void fmi3FreeInstance(fmi3Instance c) { freed(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean d, fmi3Float64 t, fmi3Float64 a, fmi3Boolean e, fmi3Float64 b) { return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return started(c); }
fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c) { return again(c); }
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 x[], size_t m) { return get(c, vr, n, x); }
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 x[], size_t m) { return put(c, vr, n, x); }
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no, fmi3Boolean *event, fmi3Boolean *ends,
                      fmi3Boolean *early, fmi3Float64 *last) {
    *event = *ends = *early = 0;
    *last = t + h;
    return stepped(c, t, h);
}
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

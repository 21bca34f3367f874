/* A co-simulation slave of FMI 2.0 or 3.0 (-DFMI=2, -DFMI=3) around the model in model.h, for tests. All variables are doubles.

   model.h defines COUNT, START {..}, and the functions
       static void outputs(double *v)                         whatever depends on inputs and states
       static int advance(double *v, double t, double h)      one step; not 0: it fails
   BAD_RESET: fmiReset does nothing; NO_RESET: it fails; NOISY: a number that is never the same is added. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"
#include "refused.h"

typedef struct {
    double v[COUNT];
#if FMI == 2
    const fmi2CallbackFunctions *callbacks;
#else
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
#endif
} Slave;

static const double start[COUNT] = START;
static int alive; /* instances: a test asks for them */
int instances(void) { return alive; }

static Slave *fresh(void) {
    Slave *s = calloc(1, sizeof *s);
    memcpy(s->v, start, sizeof start);
    ++alive;
    return s;
}

static void complain(Slave *s, double t) {
    char text[100];
    snprintf(text, sizeof text, "the level became %g at %g s", s->v[1], t);
#if FMI == 2
    s->callbacks->logger(s->callbacks->componentEnvironment, "slave", fmi2Error, "logStatusError", "%s", text);
#else
    s->log(s->environment, fmi3Error, "logStatusError", text);
#endif
}

static int stepped(Slave *s, double t, double h) {
    outputs(s->v);
    if (advance(s->v, t, h)) {
        complain(s, t);
        return 3;
    }
    return 0;
}

static void put(Slave *s, const unsigned *vr, size_t n, const double *x) {
    for (size_t i = 0; i < n; ++i) s->v[vr[i]] = x[i];
}

static void get(Slave *s, const unsigned *vr, size_t n, double *x) {
    outputs(s->v);
    for (size_t i = 0; i < n; ++i) x[i] = s->v[vr[i]];
#ifdef NOISY
    static double more;
    x[0] += more += 1e-6;
#endif
}

static int again(Slave *s) {
#ifdef NO_RESET
    return 3;
#endif
#ifndef BAD_RESET
    memcpy(s->v, start, sizeof start);
#endif
    (void)s;
    return 0;
}

#if FMI == 2
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String k[]) { return fmi2OK; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean on) {
    Slave *s = fresh();
    s->callbacks = callbacks;
    return s;
}
void fmi2FreeInstance(fmi2Component c) { --alive; free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real t, fmi2Real a, fmi2Boolean e, fmi2Real b) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return again(c); }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real x[]) { get(c, vr, n, x); return fmi2OK; }
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real x[]) { put(c, vr, n, x); return fmi2OK; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no) { return stepped(c, t, h); }
#else
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String k[]) { return fmi3OK; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible, fmi3Boolean on,
                                         fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference r[], size_t n,
                                         fmi3InstanceEnvironment e, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback u) {
    Slave *s = fresh();
    s->log = log;
    s->environment = e;
    return s;
}
void fmi3FreeInstance(fmi3Instance c) { --alive; free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean d, fmi3Float64 t, fmi3Float64 a, fmi3Boolean e, fmi3Float64 b) { return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c) { return again(c); }
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 x[], size_t m) { get(c, vr, n, x); return fmi3OK; }
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 x[], size_t m) { put(c, vr, n, x); return fmi3OK; }
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no, fmi3Boolean *event, fmi3Boolean *ends,
                      fmi3Boolean *early, fmi3Float64 *last) {
    *event = *ends = *early = 0;
    *last = t + h;
    return stepped(c, t, h);
}
#endif

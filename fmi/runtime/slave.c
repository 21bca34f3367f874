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

#include "refused.h"
#include "start.h"

#if FMI == 2
#define ERROR fmi2Error
#else
#define ERROR fmi3Error
#endif

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
#else
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String k[]) { return fmi3OK; }
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
#endif

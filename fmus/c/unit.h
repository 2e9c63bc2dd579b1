/* FMI 2.0 for co-simulation, for components written in C.
 *
 * The component's file includes variables.h, which `yawbench build` generates from modelDescription.xml
 * (`Variables`: a double per variable, by name), and then defines
 *
 *     State                                           the state between steps
 *     void start(State *, const Variables *, double t)              sets the state at start time
 *     void advance(State *, const Variables *, double t, double h)  advances the state from t to t + h
 *     void output(const State *, Variables *, double t)             sets all outputs at t
 *
 * all static, and includes this file last. As with a component in Python, outputs are computed when they
 * are read until initialization ends, and after every step from then on; parameters out of range are
 * refused with a sentence. State and variables are saved and restored as a memory image, so a State must
 * not contain pointers. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calling_sequence.h"
#include "fmi2.h"
#include "oldest_glibc.h"

#if defined _WIN32
#define FMI2_EXPORT __declspec(dllexport)
#else
#define FMI2_EXPORT __attribute__((visibility("default")))
#endif

typedef struct {
    Variables v;
    State state;
    double start_time;
    Progress at;
    int initializing; /* until initialization ends, outputs follow the inputs */
    int stale;        /* a variable has been set since the outputs were computed */
} Content;

typedef struct {
    fmi2CallbackFunctions host;
    char name[256];
    Content now;
} Instance;

/* Send a sentence to the host's log. Log text is a printf format, so '%' is doubled. */
static fmi2Status fail(const Instance *instance, const char *format, ...)
{
    char text[512], safe[2 * sizeof text], *end = safe;
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    for (const char *c = text; *c != '\0'; c++) {
        *end++ = *c;
        if (*c == '%') {
            *end++ = '%';
        }
    }
    *end = '\0';
    if (instance->host.logger != NULL) {
        instance->host.logger(instance->host.componentEnvironment, instance->name, fmi2Error, "logStatusError", safe);
    }
    return fmi2Error;
}

static void begin(Content *content)
{
    double *values = (double *)&content->v;
    memset(content, 0, sizeof *content);
    for (size_t i = 0; i < N_VARIABLES; i++) {
        values[i] = DECLARED[i].start;
    }
    content->initializing = 1;
    content->stale = 1;
}

static fmi2Status refresh(Instance *instance)
{
    const double *values = (const double *)&instance->now.v;
    for (size_t i = 0; i < N_VARIABLES; i++) {
        const char *name = DECLARED[i].name;
        if (DECLARED[i].causality != PARAMETER) {
            continue;
        }
        if (!isfinite(values[i])) {
            return fail(instance, "%s must be a finite number (got %g)", name, values[i]);
        }
        if (values[i] < DECLARED[i].min) {
            return fail(instance, "%s must be at least %g (got %g)", name, DECLARED[i].min, values[i]);
        }
        if (values[i] > DECLARED[i].max) {
            return fail(instance, "%s must be at most %g (got %g)", name, DECLARED[i].max, values[i]);
        }
    }
    memset(&instance->now.state, 0, sizeof instance->now.state);
    start(&instance->now.state, &instance->now.v, instance->now.start_time);
    output(&instance->now.state, &instance->now.v, instance->now.start_time);
    instance->now.stale = 0;
    return fmi2OK;
}

/* ---- life cycle ---- */

FMI2_EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI2_EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

FMI2_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *host, fmi2Boolean visible,
                                          fmi2Boolean logging_on)
{
    (void)resources, (void)visible, (void)logging_on;
    Instance *instance = calloc(1, sizeof *instance);
    if (instance == NULL) {
        return NULL;
    }
    instance->host = *host;
    snprintf(instance->name, sizeof instance->name, "%s", name);
    if (type != fmi2CoSimulation || guid == NULL || strcmp(guid, GUID) != 0) {
        fail(instance, type != fmi2CoSimulation ? "this FMU is for co-simulation"
                                            : "the GUID is not that of this FMU: the model description is of another build");
        free(instance);
        return NULL;
    }
    begin(&instance->now);
    return instance;
}

FMI2_EXPORT void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

FMI2_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                                           fmi2Real start_time, fmi2Boolean stop_defined, fmi2Real stop_time)
{
    Instance *instance = c;
    Refusal why;
    (void)tolerance_defined, (void)tolerance;
    if (!set_up(&instance->now.at, start_time, stop_defined, stop_time, &why)) {
        return fail(instance, "%s", why.text);
    }
    instance->now.start_time = start_time;
    instance->now.stale = 1;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    Instance *instance = c;
    Refusal why;
    return pass_on(&instance->now.at, BEFORE_INITIALIZATION, DURING_INITIALIZATION, "fmi2EnterInitializationMode", &why)
               ? fmi2OK
               : fail(instance, "%s", why.text);
}

FMI2_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    Instance *instance = c;
    Refusal why;
    if (!pass_on(&instance->now.at, DURING_INITIALIZATION, AFTER_INITIALIZATION, "fmi2ExitInitializationMode", &why)) {
        return fail(instance, "%s", why.text);
    }
    fmi2Status status = instance->now.stale ? refresh(instance) : fmi2OK;
    instance->now.initializing = 0;
    return status;
}

FMI2_EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep)
{
    (void)keep;
    Instance *instance = c;
    Content *now = &instance->now;
    Refusal why;
    if (!may_step(&now->at, t, h, &why)) {
        return fail(instance, "%s", why.text);
    }
    advance(&now->state, &now->v, t, h);
    output(&now->state, &now->v, t + h);
    now->at.time = t + h;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    Instance *instance = c;
    Refusal why;
    return terminate(&instance->now.at, &why) ? fmi2OK : fail(instance, "%s", why.text);
}

FMI2_EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    begin(&((Instance *)c)->now);
    return fmi2OK;
}

/* ---- values ---- */

FMI2_EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real values[])
{
    Instance *instance = c;
    for (size_t i = 0; i < n; i++) {
        if (r[i] >= N_VARIABLES) {
            return fail(instance, "there is no Real with the value reference %u", r[i]);
        }
        if (DECLARED[r[i]].causality == OUTPUT && instance->now.initializing && instance->now.stale &&
            refresh(instance) != fmi2OK) {
            return fmi2Error;
        }
        values[i] = ((const double *)&instance->now.v)[r[i]];
    }
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real values[])
{
    Instance *instance = c;
    for (size_t i = 0; i < n; i++) {
        if (r[i] >= N_VARIABLES) {
            return fail(instance, "there is no Real with the value reference %u", r[i]);
        }
        if (DECLARED[r[i]].causality == OUTPUT) {
            return fail(instance, "%s cannot be set", DECLARED[r[i]].name);
        }
        if (DECLARED[r[i]].causality == PARAMETER && !instance->now.initializing) {
            return fail(instance, "%s cannot be set after initialization", DECLARED[r[i]].name);
        }
        ((double *)&instance->now.v)[r[i]] = values[i];
    }
    instance->now.stale = 1;
    return fmi2OK;
}

/* ---- state ---- */

FMI2_EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    Instance *instance = c;
    if (*state == NULL) {
        *state = calloc(1, sizeof instance->now);
    }
    if (*state == NULL) {
        return fail(instance, "there is no memory for the state");
    }
    memcpy(*state, &instance->now, sizeof instance->now);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    memcpy(&((Instance *)c)->now, state, sizeof(Content));
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(Content);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (size < sizeof(Content)) {
        return fail(c, "a saved state has %zu bytes, not %zu", sizeof(Content), size);
    }
    memcpy(bytes, state, sizeof(Content));
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                               fmi2FMUstate *state)
{
    if (size != sizeof(Content)) {
        return fail(c, "a saved state has %zu bytes, not %zu", sizeof(Content), size);
    }
    fmi2Status status = fmi2GetFMUstate(c, state);
    if (status == fmi2OK) {
        memcpy(*state, bytes, size);
    }
    return status;
}

/* ---- functions that are not supported ---- */

#define FMI2_NOTHING(name, parameters)                                                                      \
    FMI2_EXPORT fmi2Status fmi2##name parameters                                                            \
    {                                                                                                       \
        (void)values;                                                                                       \
        return n == 0 ? fmi2OK : fail(c, "all variables of this FMU are Real");                            \
    }
FMI2_NOTHING(GetInteger, (fmi2Component c, const fmi2ValueReference *r, size_t n, fmi2Integer values[]))
FMI2_NOTHING(GetBoolean, (fmi2Component c, const fmi2ValueReference *r, size_t n, fmi2Boolean values[]))
FMI2_NOTHING(GetString, (fmi2Component c, const fmi2ValueReference *r, size_t n, fmi2String values[]))
FMI2_NOTHING(SetInteger, (fmi2Component c, const fmi2ValueReference *r, size_t n, const fmi2Integer values[]))
FMI2_NOTHING(SetBoolean, (fmi2Component c, const fmi2ValueReference *r, size_t n, const fmi2Boolean values[]))
FMI2_NOTHING(SetString, (fmi2Component c, const fmi2ValueReference *r, size_t n, const fmi2String values[]))

FMI2_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[])
{
    (void)c, (void)on, (void)n, (void)names;
    return fmi2OK; /* only errors are logged, and always */
}

FMI2_EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime) {
        return fail(c, "fmi2GetRealStatus knows of fmi2LastSuccessfulTime alone");
    }
    *value = ((Instance *)c)->now.at.time;
    return fmi2OK;
}

#define FMI2_UNSUPPORTED(name, parameters)                                                                  \
    FMI2_EXPORT fmi2Status fmi2##name parameters { return fail(c, "fmi2%s is not supported", #name); }
FMI2_UNSUPPORTED(GetDirectionalDerivative,
                 (fmi2Component c, const fmi2ValueReference u[], size_t n_u, const fmi2ValueReference k[], size_t n_k,
                  const fmi2Real d_k[], fmi2Real d_u[]))
FMI2_UNSUPPORTED(SetRealInputDerivatives, (fmi2Component c, const fmi2ValueReference r[], size_t n,
                                           const fmi2Integer order[], const fmi2Real values[]))
FMI2_UNSUPPORTED(GetRealOutputDerivatives, (fmi2Component c, const fmi2ValueReference r[], size_t n,
                                            const fmi2Integer order[], fmi2Real values[]))
FMI2_UNSUPPORTED(CancelStep, (fmi2Component c))
FMI2_UNSUPPORTED(GetStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Status *value))
FMI2_UNSUPPORTED(GetIntegerStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value))
FMI2_UNSUPPORTED(GetBooleanStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value))
FMI2_UNSUPPORTED(GetStringStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2String *value))

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
#include "seal.h"

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
    Instance *instance = host == NULL ? NULL : calloc(1, sizeof *instance);
    if (instance == NULL) {
        return NULL;
    }
    instance->host = *host;
    snprintf(instance->name, sizeof instance->name, "%s", name == NULL ? "" : name);
    const char *problem = *instance->name == '\0'    ? "fmi2Instantiate needs an instance name in UTF-8"
                          : type != fmi2CoSimulation ? "this FMU is for co-simulation only"
                          : guid == NULL || strcmp(guid, GUID) != 0
                              ? "the GUID is not that of this FMU: the model description is of another build"
                              : NULL;
    if (problem != NULL) {
        fail(instance, "%s", problem);
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

/* Return from the calling function unless its instance `c` exists. */
#define UNIT(c)                                                                                             \
    Instance *instance = (c);                                                                               \
    if (instance == NULL) {                                                                                 \
        return fmi2Error;                                                                                   \
    }

#define REQUIRE(condition, text)                                                                            \
    if (!(condition)) {                                                                                     \
        return fail(instance, "%s", text);                                                                  \
    }

FMI2_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                                           fmi2Real start_time, fmi2Boolean stop_defined, fmi2Real stop_time)
{
    UNIT(c)
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
    UNIT(c)
    Refusal why;
    return pass_on(&instance->now.at, BEFORE_INITIALIZATION, DURING_INITIALIZATION, "fmi2EnterInitializationMode", &why)
               ? fmi2OK
               : fail(instance, "%s", why.text);
}

FMI2_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    UNIT(c)
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
    UNIT(c)
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
    UNIT(c)
    Refusal why;
    return terminate(&instance->now.at, &why) ? fmi2OK : fail(instance, "%s", why.text);
}

FMI2_EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    UNIT(c)
    begin(&instance->now);
    return fmi2OK;
}

/* ---- values ---- */

FMI2_EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real values[])
{
    UNIT(c)
    REQUIRE(n == 0 || (r != NULL && values != NULL), "fmi2GetReal: value references or values are missing")
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
    UNIT(c)
    REQUIRE(n == 0 || (r != NULL && values != NULL), "fmi2SetReal: value references or values are missing")
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
    UNIT(c)
    REQUIRE(state != NULL, "fmi2GetFMUstate: no place for the state")
    if (*state == NULL) {
        *state = calloc(1, sizeof instance->now);
    }
    REQUIRE(*state != NULL, "fmi2GetFMUstate: out of memory")
    memcpy(*state, &instance->now, sizeof instance->now);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    UNIT(c)
    REQUIRE(state != NULL, "fmi2SetFMUstate: no state given")
    memcpy(&instance->now, state, sizeof(Content));
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    UNIT(c)
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

/* Serialized state: content, seal. */
FMI2_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    UNIT(c)
    REQUIRE(state != NULL && size != NULL, "fmi2SerializedFMUstateSize: no state, or no place for its size")
    *size = sizeof(Content) + sizeof(Seal);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    UNIT(c)
    REQUIRE(bytes != NULL, "fmi2SerializeFMUstate: no place for the bytes")
    REQUIRE(state != NULL, "fmi2SerializedFMUstateSize: no state, or no place for its size")
    REQUIRE(size >= sizeof(Content) + sizeof(Seal), "fmi2SerializeFMUstate: the place for the bytes is too small")
    memcpy(bytes, state, sizeof(Content));
    seal(GUID, bytes, sizeof(Content));
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                               fmi2FMUstate *state)
{
    UNIT(c)
    REQUIRE(bytes != NULL && state != NULL, "fmi2DeSerializeFMUstate: no bytes, or no place for the state")
    REQUIRE(size == sizeof(Content) + sizeof(Seal) && is_sealed(GUID, bytes, size),
            "fmi2DeSerializeFMUstate: not a state of this FMU")
    fmi2Status status = fmi2GetFMUstate(c, state);
    if (status == fmi2OK) {
        memcpy(*state, bytes, sizeof(Content));
    }
    return status;
}

/* ---- functions that are not supported ---- */

#define FMI2_NOTHING(name, parameters)                                                                      \
    FMI2_EXPORT fmi2Status fmi2##name parameters                                                            \
    {                                                                                                       \
        UNIT(c)                                                                                             \
        (void)values;                                                                                       \
        return n == 0 ? fmi2OK : fail(instance, "all variables of this FMU are Real");                      \
    }
FMI2_NOTHING(GetInteger, (fmi2Component c, const fmi2ValueReference *r, size_t n, fmi2Integer values[]))
FMI2_NOTHING(GetBoolean, (fmi2Component c, const fmi2ValueReference *r, size_t n, fmi2Boolean values[]))
FMI2_NOTHING(GetString, (fmi2Component c, const fmi2ValueReference *r, size_t n, fmi2String values[]))
FMI2_NOTHING(SetInteger, (fmi2Component c, const fmi2ValueReference *r, size_t n, const fmi2Integer values[]))
FMI2_NOTHING(SetBoolean, (fmi2Component c, const fmi2ValueReference *r, size_t n, const fmi2Boolean values[]))
FMI2_NOTHING(SetString, (fmi2Component c, const fmi2ValueReference *r, size_t n, const fmi2String values[]))

FMI2_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[])
{
    UNIT(c)
    (void)on;
    REQUIRE(n == 0 || names != NULL, "fmi2SetDebugLogging: no categories given")
    return fmi2OK; /* only errors are logged, and always */
}

FMI2_EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    UNIT(c)
    REQUIRE(value != NULL, "fmi2GetRealStatus: no place for the value")
    REQUIRE(kind == fmi2LastSuccessfulTime, "fmi2GetRealStatus knows of fmi2LastSuccessfulTime alone")
    *value = instance->now.at.time;
    return fmi2OK;
}

#define UNSUPPORTED(name, parameters, ...)                                                                  \
    FMI2_EXPORT fmi2Status fmi2##name parameters                                                            \
    {                                                                                                       \
        __VA_ARGS__;                                                                                        \
        UNIT(c)                                                                                             \
        return fail(instance, "fmi2" #name " is not supported");                                            \
    }
FMI2_UNSUPPORTED_FUNCTIONS(UNSUPPORTED)
